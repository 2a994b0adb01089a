import hashlib
import math
import os
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest

from mine_loc_coarse import monitor_protocol
from mine_loc_coarse.bearing_report import BearingReport
from mine_loc_core.people import load_people
from mine_loc_core.site import Site, UwbReceiver, load_site
from mine_loc_core.stamps import NS_PER_S, NS_PER_US
from mine_loc_pdr.fdilink import AhrsFrame, FdilinkDecoder, ImuFrame
from mine_loc_sim.byte_streams import byte_blocks
from mine_loc_sim.scenario import Scenario
from mine_loc_sim.scene import SceneOptions, crew, line_formats
from mine_loc_uwb.ranging import CirWindow, RangingRound, TdoaBlink
from mine_loc_uwb.wire.detect import make_decoder

CONFIG = Path(__file__).parents[3] / "config"
FULL_RATE_S = float(os.environ.get("MINE_LOC_SIM_SECONDS", "20"))  # `make nightly` asks for ten minutes
SHORT = SceneOptions(seed=3, seconds=2.0, cir=True, tdoa=True)


@dataclass
class Heard:
    """What the drivers' decoders made of all lines."""

    messages: dict[str, list[object]] = field(default_factory=dict)
    counts: Counter[str] = field(default_factory=Counter)
    losses: dict[str, Counter[str]] = field(default_factory=dict)
    digest: str = ""


def reader(spoken: str) -> Any:
    """The driver's own decoder of a line."""
    others: dict[str, Callable[[], object]] = {"fdilink": FdilinkDecoder, "mldf": monitor_protocol.decoder}
    return others[spoken]() if spoken in others else make_decoder(spoken)


def listen(scenario: Scenario, *, keep: bool = True) -> Heard:
    formats = line_formats(scenario.site, scenario.people)
    decoders = {line: reader(formats[line]) for line in scenario.lines}
    heard, digest = Heard({line: [] for line in decoders}), hashlib.sha256()
    for block in byte_blocks(scenario):
        for line, arrivals in block.items():
            for _, data in arrivals:
                assert isinstance(data, bytes)
                digest.update(data)
                messages = decoders[line].feed(data)
                heard.counts[line] += len(messages)
                if keep:
                    heard.messages[line] += messages
    heard.losses = {line: decoder.losses for line, decoder in decoders.items()}
    heard.digest = digest.hexdigest()
    return heard


def scenario(options: SceneOptions = SHORT, site: str = "example_mine", people: int = 2) -> Scenario:
    loaded = load_site(CONFIG / site)
    return Scenario(loaded, crew(loaded, tuple(load_people(CONFIG / site)), people), options)


def of_type(messages: Iterable[object], kind: type) -> list[object]:
    return [message for message in messages if isinstance(message, kind)]


def test_the_drivers_decoders_lose_nothing_of_ten_people_at_full_rate():
    scene = scenario(SceneOptions(seed=1, seconds=FULL_RATE_S, tdoa=True), people=10)
    heard = listen(scene, keep=False)
    assert all(not +losses for losses in heard.losses.values()), heard.losses
    for line in ("fitter/n100", "walker_7/n100"):
        assert heard.counts[line] == pytest.approx(200 * FULL_RATE_S, abs=2)
    assert heard.counts["portal"] + heard.counts["junction"] > 10 * 10 * FULL_RATE_S


def test_the_same_seed_gives_the_same_bytes_and_another_seed_others():
    digests = [listen(scenario(replace(SHORT, seed=seed)), keep=False).digest for seed in (3, 3, 4)]
    assert digests[0] == digests[1] != digests[2]


def test_our_frames_bring_back_rounds_differences_and_accumulators_as_measured():
    scene, again = scenario(), scenario()
    heard = listen(scene)
    sent = [frame for block in again.blocks() for line in ("portal", "junction") for _, frame in block.frames[line]]
    got = heard.messages["portal"] + heard.messages["junction"]
    for kind in (RangingRound, TdoaBlink, CirWindow):
        assert of_type(got, kind)
    assert len(got) == len(sent)
    rounds = {(each.tag_id, each.seq): each for each in of_type(got, RangingRound)}
    for frame in sent:
        if hasattr(frame, "ranging"):
            back = rounds[frame.ranging.tag_id, frame.ranging.seq]
            assert back.device_ticks == frame.ranging.device_ticks
            for one, other in zip(frame.ranging.ranges, back.ranges, strict=True):
                assert other.range_m == pytest.approx(one.range_m, abs=5.1e-4, nan_ok=True)
                assert other.receive_power_dbm == pytest.approx(one.receive_power_dbm, nan_ok=True)


def test_an_n100_line_brings_both_messages_with_gravity_pointing_down():
    messages = listen(scenario()).messages["fitter/n100"]
    samples, attitudes = of_type(messages, ImuFrame), of_type(messages, AhrsFrame)
    assert abs(len(samples) - len(attitudes)) <= 1
    forces = [sample.specific_force_m_s2[2] for sample in samples]
    assert sum(forces) / len(forces) == pytest.approx(-9.8, abs=0.5)


def test_a_trek1000_line_carries_corrected_ranges_with_a_millisecond_clock():
    scene, again = (scenario(replace(SHORT, tdoa=False), "laboratory") for _ in range(2))
    rounds = of_type(listen(scene).messages["lab"], RangingRound)
    raw = [frame for block in again.blocks() for _, frame in block.frames["lab"] if hasattr(frame, "heard")]
    assert len(rounds) == len(raw) > 30
    for back, sent in zip(rounds, raw, strict=True):
        assert back.corrected
        assert back.device_ticks == sent.ranging.device_ticks // 1000 % 2**32
        for one in back.ranges:
            place = next(i for i, each in enumerate(sent.ranging.ranges) if each.anchor_id == one.anchor_id)
            bias_m = sent.heard.level_bias_m[place]
            assert one.range_m == pytest.approx(sent.ranging.ranges[place].range_m - bias_m, abs=5.1e-4)


def test_a_dwm1001_on_a_tag_prints_the_rounds_of_that_tag_alone():
    site: Site = load_site(CONFIG / "laboratory")
    own = UwbReceiver("own", "/dev/own", "dwm1001_shell", 115200, None, 2)
    site = replace(site, uwb_receivers=(own,))
    people = tuple(load_people(CONFIG / "laboratory"))
    heard = listen(Scenario(site, people, SHORT))
    assert not +heard.losses["own"]
    assert 17 <= len(of_type(heard.messages["own"], RangingRound)) <= 20


def test_monitors_lines_bring_every_report_that_is_not_lost_about_everybody_in_range():
    options = SceneOptions(seed=2, seconds=20.0)
    heard = listen(scenario(options, "field_15km", people=12))
    assert all(not +losses for losses in heard.losses.values()), heard.losses
    truth = [bearing for block in scenario(options, "field_15km", people=12).blocks() for bearing in block.bearings]
    due = [bearing for bearing in truth if bearing.sent_ns is not None and bearing.sent_ns < 20 * NS_PER_S]
    got = [report for monitor in range(1, 9) for report in heard.messages[f"monitor_{monitor}"]]
    assert len({bearing.emitter for bearing in truth}) == 12
    assert len(got) == len(due) > 50
    measured_rad: dict[tuple[int, int], list[float]] = {}  # several of emitters on one channel
    for each in due:
        key = each.monitor_id, each.stamp_ns // NS_PER_US
        measured_rad.setdefault(key, []).append(each.azimuth_rad + each.error_rad)
    for report in got:
        assert isinstance(report, BearingReport)
        nearest = measured_rad[report.monitor_id, report.stamp_ns // NS_PER_US]
        assert min(abs(math.remainder(report.azimuth_rad - each, math.tau)) for each in nearest) <= math.radians(0.0051)
