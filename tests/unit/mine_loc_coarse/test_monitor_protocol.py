import math
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_coarse.bearing_report import BearingReport
from mine_loc_coarse.monitor_protocol import checksum, compass_deg, decoder, encode_report, yaw_rad

SPECIFICATION = Path(__file__).parents[3] / "docs" / "wire-formats.md"
REPORT = BearingReport(
    monitor_id=3,
    stamp_ns=123_456_789_000,
    start_frequency_hz=433_512_000.0,
    stop_frequency_hz=433_524_500.0,
    frequency_count=1,
    dwell_time_s=0.02,
    level_dbm=-87.4,
    azimuth_rad=yaw_rad(123.45),
    confidence=0.8,
)
LINE = encode_report(REPORT)

reports = st.builds(
    BearingReport,
    monitor_id=st.integers(1, 2**32 - 1),
    stamp_ns=st.integers(0, 2**63 - 1),
    start_frequency_hz=st.floats(0.0, 1e10),
    stop_frequency_hz=st.floats(1e10, 1e12),
    frequency_count=st.integers(1, 2**32 - 1),
    dwell_time_s=st.floats(0.0, 9999.0),
    level_dbm=st.one_of(st.just(math.nan), st.floats(-200.0, 50.0)),
    azimuth_rad=st.floats(-10.0, 10.0),
    confidence=st.floats(0.0, 1.0),
)
pieces = st.one_of(st.just(LINE), st.binary(max_size=40), st.integers(0, len(LINE)).map(lambda cut: LINE[:cut]))
streams = st.lists(pieces, max_size=12).map(b"".join)


def sentence(content: str) -> bytes:
    return f"${content}*{checksum(content):02X}\r\n".encode()


def lost(data: bytes) -> dict[str, int]:
    """What is counted where nothing may be decoded."""
    reading = decoder()
    assert reading.feed(data) == []
    return dict(reading.losses)


def turn(a_rad: float, b_rad: float) -> float:
    return math.remainder(a_rad - b_rad, math.tau)


def test_the_example_of_the_specification_says_the_report_beside_it():
    examples = [line.strip() for line in SPECIFICATION.read_text("utf-8").splitlines() if line.startswith("    $MLDF,")]
    assert LINE.decode().strip() in examples
    assert decoder().feed(LINE) == [REPORT]


@pytest.mark.parametrize(
    ("azimuth_deg", "yaw_deg"), [(0.0, 90.0), (90.0, 0.0), (180.0, -90.0), (270.0, 180.0), (225.0, -135.0)]
)
def test_azimuth_from_north_clockwise_becomes_yaw_from_east_counter_clockwise(azimuth_deg: float, yaw_deg: float):
    assert math.degrees(yaw_rad(azimuth_deg)) == pytest.approx(yaw_deg, abs=1e-12)
    assert compass_deg(math.radians(yaw_deg)) == pytest.approx(azimuth_deg, abs=1e-12)


@given(report=reports)
def test_a_report_comes_back_rounded_to_the_digits_of_the_line(report: BearingReport):
    (back,) = decoder().feed(encode_report(report))
    assert 0 <= report.stamp_ns - back.stamp_ns < 1000
    assert abs(turn(back.azimuth_rad, report.azimuth_rad)) <= math.radians(0.005) + 1e-9
    assert -math.pi < back.azimuth_rad <= math.pi
    assert back.start_frequency_hz == pytest.approx(report.start_frequency_hz, rel=0, abs=0.5)
    assert back.stop_frequency_hz == pytest.approx(report.stop_frequency_hz, rel=0, abs=0.5)
    assert back.dwell_time_s == pytest.approx(report.dwell_time_s, rel=0, abs=5.001e-4)
    assert back.level_dbm == pytest.approx(report.level_dbm, rel=0, abs=0.05001, nan_ok=True)
    assert back.confidence == pytest.approx(report.confidence, rel=0, abs=5.001e-3)
    assert (back.monitor_id, back.frequency_count) == (report.monitor_id, report.frequency_count)
    assert encode_report(back) == encode_report(report)


@pytest.mark.parametrize("yaw_deg", [90.004, 90.0, 89.996, 450.0])
def test_an_azimuth_that_rounds_to_full_circle_is_north(yaw_deg: float):
    assert b",000.00," in encode_report(replace(REPORT, azimuth_rad=math.radians(yaw_deg)))


@pytest.mark.parametrize(
    "change",
    [
        {"monitor_id": 0},
        {"stamp_ns": -1000},
        {"stop_frequency_hz": 1.0},
        {"start_frequency_hz": -1.0},
        {"frequency_count": 0},
        {"dwell_time_s": math.inf},
        {"level_dbm": math.inf},
        {"azimuth_rad": math.nan},
        {"azimuth_rad": math.inf},
        {"confidence": 1.1},
    ],
    ids=str,
)
def test_what_does_not_fit_the_wire_is_refused_when_encoding(change: dict[str, float]):
    with pytest.raises(ValueError, match="allowed"):
        encode_report(replace(REPORT, **change))


@given(stream=streams, sizes=st.lists(st.integers(1, 60), min_size=1, max_size=5))
def test_chunking_changes_neither_reports_nor_losses(stream: bytes, sizes: list[int]):
    whole, chunked = decoder(), decoder()
    expected, got, rest = whole.feed(stream), [], stream
    while rest:
        for size in sizes:
            got += chunked.feed(rest[:size])
            rest = rest[size:]
    assert got == expected
    assert chunked.losses == whole.losses


@given(at=st.integers(0, len(LINE) - 3), flip=st.integers(1, 255))
def test_damage_of_one_character_never_gives_a_report_and_is_counted(at: int, flip: int):
    damaged = bytearray(LINE)
    damaged[at] ^= flip
    assert sum(lost(bytes(damaged)).values()) > 0


@given(stream=streams)
def test_a_good_line_after_any_damage_is_found(stream: bytes):
    reading = decoder()
    reading.feed(stream)
    assert reading.feed(LINE)[-1] == REPORT


def test_a_line_whose_end_was_lost_costs_none_of_its_neighbours():
    reading = decoder()
    assert reading.feed(LINE[:30] + LINE + LINE.strip() + LINE) == [REPORT] * 3
    assert reading.losses == {"unrecognised_line": 1}


GOOD = LINE.decode()[1 : LINE.index(b"*")]


@pytest.mark.parametrize(
    ("data", "kind"),
    [
        (LINE.replace(b"123.45", b"123.46"), "checksum"),
        (b"hello\r\n", "unrecognised_line"),
        (sentence("GPRMC,1"), "unrecognised_line"),
        (LINE.replace(b"*", b""), "unrecognised_line"),
        (sentence(GOOD + ",1"), "field_count"),
        (sentence(GOOD.replace("123.45", "360.00")), "field_value"),
        (sentence(GOOD.replace("123.45", "23.45")), "field_value"),
        (sentence(GOOD.replace("MLDF,3", "MLDF,0")), "field_value"),
        (sentence(GOOD.replace("MLDF,3", "MLDF,4294967296")), "field_value"),
        (sentence(GOOD.replace("123456789", "9223372036854776")), "field_value"),
        (sentence(GOOD.replace("433524500", "433500000")), "field_value"),
        (sentence(GOOD.replace(",1,", ",0,")), "field_value"),
        (sentence(GOOD.replace("-87.4", "nan")), "field_value"),
        (sentence(GOOD.replace("0.80", "1.01")), "field_value"),
        (b"$" + b"1" * 2000 + b"\r\n", "overlong_line"),
    ],
)
def test_a_loss_is_counted_by_the_check_that_failed(data: bytes, kind: str):
    assert lost(data) == {kind: 1}


def test_a_partial_line_does_not_outlive_a_reset():
    reading = decoder()
    reading.feed(LINE[:20])
    reading.reset()
    assert reading.feed(LINE) == [REPORT]
    assert reading.losses == {"partial_line": 1}
