"""Emulated monitors over TCP become regions, which start the fusion: bytes -> monitor_driver -> coarse -> fusion."""

import math
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import yaml
from graph.domains import lent_domain
from graph.observer import Observer
from graph.processes import running, up_command
from mine_loc_interfaces.msg import (
    BearingArray,
    CoarseRegion,
    CoarseRegionArray,
    PersonPose,
    PersonPoseArray,
    UwbRange,
    UwbRangeArray,
    WakeAnchors,
)

from mine_loc_coarse.monitor_protocol import encode_report
from mine_loc_core.nodes.qos import EVENTS
from mine_loc_core.site import Monitor
from mine_loc_core.stamps import NS_PER_S
from mine_loc_sim.bearing_emulator import BearingEmulator, MonitorErrors
from mine_loc_sim.serial_lines import TcpBridge

pytestmark = pytest.mark.graph
PLACES_M = {1: (0.0, 0.0, 2.0), 2: (4000.0, 0.0, 2.0), 3: (2000.0, 3500.0, 2.0)}
EMITTER_M = np.array([1500.0, 1200.0, 0.0])
TAG = 5
ANCHORS_M = {7: (1480.0, 1180.0, 2.0), 8: (1520.0, 1180.0, 3.0), 9: (1520.0, 1220.0, 2.0), 10: (1480.0, 1220.0, 3.0)}


def write_coarse_site(folder: Path, ports: dict[int, str], frequency_hz: float = 1e9) -> Path:
    folder.mkdir()
    anchors = [{"id": number, "position_m": list(place)} for number, place in ANCHORS_M.items()]
    site = {
        "schema": 1,
        "name": "made_up",
        "dimensions": 2,
        "tag_height_m": 1.0,
        "anchors": anchors,
        "monitors": [
            {"id": number, "position_m": list(place), "port": ports[number]} for number, place in PLACES_M.items()
        ],
    }
    ann = {"name": "ann", "height_m": 1.7, "tag_id": TAG, "emitter_frequency_hz": frequency_hz}
    (folder / "site.yaml").write_text(yaml.safe_dump(site))
    (folder / "people.yaml").write_text(yaml.safe_dump({"schema": 1, "people": [ann]}))
    return folder


def ranging_round(observer: Observer, seq: int) -> UwbRangeArray:
    """What ann's tag measures where the emitter is."""
    array = UwbRangeArray(tag_id=TAG, seq=seq)
    array.header.stamp = observer.node.get_clock().now().to_msg()
    tag_m = (EMITTER_M[0], EMITTER_M[1], 1.0)
    array.ranges = [
        UwbRange(anchor_id=number, range_raw=distance, range=distance, los_probability=math.nan)
        for number, place in ANCHORS_M.items()
        for distance in [math.dist(tag_m, place)]
    ]
    return array


def test_monitors_over_tcp_become_a_region_that_starts_the_fusion_until_ranges_take_over(tmp_path):
    monitors = [Monitor(number, place) for number, place in PLACES_M.items()]
    emulator = BearingEmulator(
        monitors,
        {"a": lambda stamp_ns: np.tile(EMITTER_M, (len(stamp_ns), 1))},
        MonitorErrors(longest_delay_ns=NS_PER_S // 2),
        np.random.default_rng(3),
    )
    sent, _ = emulator.play(60 * NS_PER_S)
    bridges = {number: TcpBridge() for number in PLACES_M}
    first = sent[1][0][1]
    frequency_hz = (first.start_frequency_hz + first.stop_frequency_hz) / 2.0
    addresses = {number: bridge.address for number, bridge in bridges.items()}
    site = write_coarse_site(tmp_path / "site", addresses, frequency_hz)
    with lent_domain() as domain:
        observer = Observer(domain)
        try:
            bearings = observer.listen(BearingArray, "coarse/bearings")
            regions = observer.listen(CoarseRegionArray, "coarse/regions")
            wakes = observer.listen(WakeAnchors, "coarse/wake")
            poses = observer.listen(PersonPoseArray, "fused/poses")
            ranges = observer.node.create_publisher(UwbRangeArray, "uwb/ranges", EVENTS)

            def latest() -> PersonPose:
                return poses.messages[-1].people[0] if poses.messages else PersonPose()

            with running(up_command(site), domain, tmp_path / "up.log"):
                observer.wait_for(lambda: len(regions), what="situations")
                began_s = time.monotonic()

                def played() -> bool:
                    """Each report at its time; enough when a region that all monitors made is kept."""
                    scene_ns = int((time.monotonic() - began_s) * NS_PER_S)
                    for number, reports in sent.items():
                        while reports and reports[0][0] <= scene_ns:
                            bridges[number].write(encode_report(reports.pop(0)[1]))
                    present = [region for region in regions.messages[-1].regions if region.status == CoarseRegion.KEPT]
                    return any(len(region.monitor_ids) == len(PLACES_M) for region in present)

                for bridge in bridges.values():
                    bridge.write(b"$MLDF,noise*00\r\n")
                observer.wait_for(played, 40.0, what="a region that is kept")
                observer.wait_for(lambda: wakes.messages and len(wakes.messages[-1].anchor_ids), what="anchors to wake")
                refused = observer.status
                observer.wait_for(lambda: latest().mode == PersonPose.COARSE_ONLY, what="a start from the region")
                coarse = latest()

                def taken_over() -> bool:
                    """Ten rounds a second, as a tag that was woken."""
                    nonlocal seq, next_s
                    if time.monotonic() > next_s:
                        seq, next_s = seq + 1, time.monotonic() + 0.1
                        ranges.publish(ranging_round(observer, seq))
                    return latest().mode == PersonPose.UWB_ONLY and latest().horizontal_ce95 < 2.0

                seq, next_s = 0, 0.0
                observer.wait_for(taken_over, what="ranges take over")
                fine = latest()
        finally:
            observer.close()
            for bridge in bridges.values():
                bridge.unplug()
    (region,) = regions.messages[-1].regions
    error_m = np.hypot(region.center.x - EMITTER_M[0], region.center.y - EMITTER_M[1])
    assert error_m <= 2.0 * region.radius < 400.0
    assert sorted(region.monitor_ids) == sorted(PLACES_M)
    assert {bearing.monitor_id for message in bearings.messages for bearing in message.bearings} == set(PLACES_M)
    assert sorted(wakes.messages[-1].anchor_ids) == list(ANCHORS_M)
    assert list(wakes.messages[-1].region_ids) == [region.region_id] * len(ANCHORS_M)
    assert region.person == coarse.person == "ann"
    assert coarse.horizontal_ce95 > 20.0
    assert np.hypot(fine.pose.pose.position.x - EMITTER_M[0], fine.pose.pose.position.y - EMITTER_M[1]) < 0.5
    decoders = {name: status for name, status in refused.items() if name.endswith("decoder")}
    damaged = [{pair.key: pair.value for pair in status.values} for status in decoders.values()]
    assert [figures.get("checksum") for figures in damaged] == ["1"] * len(PLACES_M)


def test_a_site_without_monitors_runs_no_coarse_node_and_the_node_alone_refuses_it(tmp_path):
    site = write_coarse_site(tmp_path / "site", dict.fromkeys(PLACES_M, "/dev/null"))
    content = yaml.safe_load((site / "site.yaml").read_text())
    content["monitors"] = []
    (site / "site.yaml").write_text(yaml.safe_dump(content))
    words = [sys.executable, "-m", "mine_loc_coarse.nodes.coarse", "--ros-args", "-p", f"site:={site}"]
    with lent_domain() as domain, running(words, domain, tmp_path / "log") as node:
        assert node.ends() == 2
        assert "monitors: none; allowed: at least one" in node.output
