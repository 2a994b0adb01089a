from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

from mine_loc_coarse import monitor_protocol
from mine_loc_coarse.bearing_report import BearingReport
from mine_loc_core.device_clock import DeviceClock
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.people import load_people
from mine_loc_core.site import load_site
from mine_loc_core.stamps import NS_PER_S, NS_PER_US
from mine_loc_pdr.fdilink import FdilinkDecoder, ImuFrame
from mine_loc_sim import imu_constants as ic
from mine_loc_sim import scene_constants as sc
from mine_loc_sim.byte_streams import byte_blocks
from mine_loc_sim.faults import Fault, FaultKind, moved_anchors, parse_fault
from mine_loc_sim.scenario import Scenario
from mine_loc_sim.scene import SceneOptions, line_names
from mine_loc_sim.timed_bytes import Arrival, Cable
from mine_loc_uwb.device_stamps import DeviceStamps
from mine_loc_uwb.ranging import RangingRound
from mine_loc_uwb.wire.decoder import Decoder
from mine_loc_uwb.wire.detect import make_decoder

FOLDER = Path(__file__).parents[3] / "config" / "vehicle"
SITE, PEOPLE = load_site(FOLDER), tuple(load_people(FOLDER))
LINES, ANCHORS = ("vehicle", "spotter/n100"), [anchor.id for anchor in SITE.anchors]
SECONDS = 3.0


@dataclass
class Heard:
    arrivals: list[Arrival]
    messages: list[tuple[int, object]] = field(default_factory=list)
    losses: Counter[str] = field(default_factory=Counter)


def play(line: str, *texts: str) -> Heard:
    """What a driver's decoder hears on a line while faults last."""
    faults = [parse_fault(text, LINES, ANCHORS) for text in texts]
    options = SceneOptions(seed=5, seconds=SECONDS, cir=True, moved_anchors=moved_anchors(faults))
    blocks = byte_blocks(Scenario(SITE, PEOPLE, options), faults)
    heard = Heard([arrival for block in blocks for arrival in block[line]])
    decoder: Decoder | FdilinkDecoder = make_decoder("mine_loc") if line == "vehicle" else FdilinkDecoder()
    for at_ns, what in heard.arrivals:
        if isinstance(what, Cable):
            decoder.reset()
        else:
            heard.messages += [(at_ns, message) for message in decoder.feed(what)]
    heard.losses = decoder.losses
    return heard


def ranges_of(heard: Heard, anchor_id: int, tag_id: int = 0x0601) -> dict[float, float]:
    rounds = [(at_ns, each) for at_ns, each in heard.messages if isinstance(each, RangingRound)]
    return {
        at_ns / NS_PER_S: measured.range_m
        for at_ns, each in rounds
        for measured in each.ranges
        if each.tag_id == tag_id and measured.anchor_id == anchor_id and not np.isnan(measured.range_m)
    }


@pytest.fixture(scope="module")
def healthy() -> dict[str, Heard]:
    return {line: play(line) for line in LINES}


def test_without_faults_nothing_is_lost(healthy: dict[str, Heard]):
    for heard in healthy.values():
        assert not +heard.losses


@pytest.mark.parametrize("line", LINES)
def test_noise_is_skipped_and_counted_and_costs_few_messages(line: str, healthy: dict[str, Heard]):
    heard = play(line, "noise@1+1")
    assert heard.losses["skipped_bytes"] > 50
    assert 0.8 * len(healthy[line].messages) < len(heard.messages) <= len(healthy[line].messages)


@pytest.mark.parametrize(
    ("line", "kinds"), [("vehicle", {"missing_frames"}), ("spotter/n100", {"lost_frames", "trailer", "crc16"})]
)
def test_truncated_messages_are_missed_by_their_number(line: str, kinds: set[str], healthy: dict[str, Heard]):
    heard = play(line, "truncation@1+1")
    missing = len(healthy[line].messages) - len(heard.messages)
    assert missing > 3
    assert sum(heard.losses[kind] for kind in kinds) >= missing
    assert heard.losses["skipped_bytes"] > 0


@pytest.mark.parametrize("line", LINES)
def test_a_stall_delays_everything_and_loses_nothing(line: str, healthy: dict[str, Heard]):
    heard = play(line, "stall@1+0.5")
    assert not +heard.losses
    assert [repr(m) for _, m in heard.messages] == [repr(m) for _, m in healthy[line].messages]
    during = [at_ns for at_ns, _ in heard.arrivals if NS_PER_S < at_ns < 1.5 * NS_PER_S]
    assert not during
    assert 1_500_000_000 in [at_ns for at_ns, _ in heard.arrivals]


@pytest.mark.parametrize("line", LINES)
def test_an_unplugged_line_is_silent_and_comes_back(line: str):
    heard = play(line, f"unplug@1+1:{line}")
    events = [(at_ns, what) for at_ns, what in heard.arrivals if isinstance(what, Cable)]
    assert [what for _, what in events] == [Cable.UNPLUGGED, Cable.PLUGGED_IN]
    assert events[1][0] == 2 * NS_PER_S
    assert not [at_ns for at_ns, what in heard.arrivals if isinstance(what, bytes) and NS_PER_S <= at_ns < 2 * NS_PER_S]
    assert [at_ns for at_ns, _ in heard.messages if at_ns > 2 * NS_PER_S]
    assert not +heard.losses


def test_a_fault_of_one_line_leaves_the_others_alone(healthy: dict[str, Heard]):
    heard = play("spotter/n100", "noise@0+3:vehicle", "truncation@0+3:vehicle", "clock_step@0+3:vehicle")
    assert heard.arrivals == healthy["spotter/n100"].arrivals


def test_a_frozen_anchor_repeats_its_last_range(healthy: dict[str, Heard]):
    heard = play("vehicle", "frozen_anchor@1+1:0x0503")
    frozen = [m for at_s, m in ranges_of(heard, 0x0503).items() if 1.02 < at_s < 2.0]
    free = [m for at_s, m in ranges_of(healthy["vehicle"], 0x0503).items() if 1.02 < at_s < 2.0]
    assert len(frozen) > 5
    assert len(set(frozen)) == 1
    assert len(set(free)) > 3
    assert ranges_of(heard, 0x0504) == ranges_of(healthy["vehicle"], 0x0504)


def test_a_moved_anchor_measures_from_where_it_truly_hangs(healthy: dict[str, Heard]):
    heard, before = play("vehicle", "moved_anchor@1+2:0x0503"), ranges_of(healthy["vehicle"], 0x0503)
    after = ranges_of(heard, 0x0503)
    assert {t: m for t, m in after.items() if t < 1.0} == {t: m for t, m in before.items() if t < 1.0}
    mean_after, mean_before = (np.mean([m for t, m in each.items() if t > 1.02]) for each in (after, before))
    assert abs(mean_after - mean_before) > 0.5


def test_a_step_of_a_receivers_clock_resets_the_stamps_twice():
    decoder = make_decoder("mine_loc")
    counts = {}
    for texts in ((), ("clock_step@1+1:vehicle",)):
        stamps = DeviceStamps(latency_ns=0, trust_device_clock=True)
        for at_ns, message in play("vehicle", *texts).messages:
            if isinstance(message, RangingRound) and message.tag_id == 0x0601:
                stamps.stamp((1, 2), decoder, message.device_ticks, at_ns)
        counts[texts] = stamps.clock_resets
    assert list(counts.values()) == [0, 2]


def test_a_step_of_an_n100_clock_resets_its_clock():
    resets = {}
    for texts in ((), ("clock_step@1+1:spotter/n100",)):
        clock = DeviceClock(1e-6, 64)
        for at_ns, message in play("spotter/n100", *texts).messages:
            if isinstance(message, ImuFrame):
                clock.stamp(message.timestamp_us, at_ns)
        resets[texts] = clock.resets
    assert list(resets.values()) == [0, 2]


def test_blows_cut_the_sensors_off_at_their_range_while_they_last():
    heard = play("spotter/n100", "imu_saturation@1+1")
    forces = {at_ns: m.specific_force_m_s2 for at_ns, m in heard.messages if isinstance(m, ImuFrame)}
    at_limit = [at_ns for at_ns, force in forces.items() if max(map(abs, force)) >= np.float32(ic.ACCEL.limit)]
    assert len(at_limit) > 90
    assert all(NS_PER_S <= at_ns < 2.01 * NS_PER_S for at_ns in at_limit)


def test_faults_are_part_of_the_seed():
    assert play("vehicle", "noise@0+3").arrivals == play("vehicle", "noise@0+3").arrivals


def test_a_fault_is_read_as_written():
    fault = parse_fault("stall@20+0.4:vehicle", LINES, ANCHORS)
    assert fault == Fault(FaultKind.STALL, 20 * NS_PER_S, 20_400_000_000, "vehicle")
    assert fault.during(20 * NS_PER_S)
    assert not fault.during(fault.stop_ns)


@pytest.mark.parametrize(
    ("text", "allowed"),
    [
        ("noise", "KIND@START"),
        ("noise@-1+5", "KIND@START"),
        ("nosie@1+5", "noise, truncation, stall"),
        ("noise@1+0", "above 0"),
        ("noise@1+5:portal", "vehicle, spotter/n100"),
        ("imu_saturation@1+5:vehicle", "allowed: spotter/n100"),
        ("frozen_anchor@1+5", "0x0501"),
        ("moved_anchor@1+5:0x0999", "0x0501"),
    ],
)
def test_a_wrong_fault_is_refused_saying_what_is_allowed(text: str, allowed: str):
    with pytest.raises(ConfigurationError, match=allowed.replace("+", r"\+")) as refusal:
        parse_fault(text, LINES, ANCHORS)
    assert text in str(refusal.value)


def test_a_step_of_a_monitors_clock_changes_its_stamps_and_nothing_else():
    folder = FOLDER.with_name("field_15km")
    site, people = load_site(folder), tuple(load_people(folder))
    options = SceneOptions(seed=5, seconds=30.0)

    def heard(*faults: Fault) -> list[BearingReport]:
        decoders = {line: monitor_protocol.decoder() for line in line_names(site, ())}
        return [
            report
            for block in byte_blocks(Scenario(site, people, options), faults)
            for line, decoder in decoders.items()
            for _, data in block[line]
            if isinstance(data, bytes)
            for report in decoder.feed(data)
        ]

    healthy, stepped = heard(), heard(parse_fault("clock_step@0+30", line_names(site, people), []))
    assert len(healthy) > 10
    late_ns = sc.CLOCK_STEP_US * NS_PER_US
    assert stepped == [replace(report, stamp_ns=report.stamp_ns + late_ns) for report in healthy]
