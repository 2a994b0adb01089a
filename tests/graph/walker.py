"""A made-up walker on a circle, as the bytes her tag and her N100 send, with the truth behind them."""

import contextlib
import math
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import yaml

from mine_loc_pdr.fdilink import AhrsFrame, ImuFrame, encode
from mine_loc_sim.serial_lines import PseudoSerial
from mine_loc_uwb.ranging import Range, RangingRound
from mine_loc_uwb.wire.mine_loc_frame import encode_frame
from mine_loc_uwb.wire.mine_loc_payload import FrameType, encode_ranges

ANCHORS = {1: (0.0, 0.0, 2.5), 2: (20.0, 0.0, 2.5), 3: (20.0, 20.0, 2.5), 4: (0.0, 20.0, 2.5), 5: (10.0, -2.0, 2.5)}
TAG_HEIGHT_M = 1.0
WALKER_TAG, VISITOR_TAG = 17, 18
STANDING_S = 1.5  # before the first step
RADIUS_M = 6.0
STEP_HZ = 1.79
SWAY_M_S2, ROLL_RAD_S = 1.2, 0.4  # of the pelvis, once a stride
SPEED_M_S = 0.7 * STEP_HZ  # the stride of paper B for a person 1.75 m tall
ROUND_PERIOD_S, SAMPLE_PERIOD_S = 0.1, 0.01


def write_site(folder: Path, receivers: list[dict[str, object]], people: list[dict[str, object]]) -> Path:
    """A site folder of our five anchors."""
    folder.mkdir(parents=True, exist_ok=True)
    site = {
        "schema": 1,
        "name": "made_up",
        "dimensions": 2,
        "tag_height_m": TAG_HEIGHT_M,
        "anchors": [{"id": key, "position_m": list(position)} for key, position in ANCHORS.items()],
        "uwb_receivers": receivers,
    }
    (folder / "site.yaml").write_text(yaml.safe_dump(site))
    write_people(folder, people)
    return folder


def write_people(folder: Path, people: list[dict[str, object]]) -> None:
    new = folder / "people.yaml.new"
    new.write_text(yaml.safe_dump({"schema": 1, "people": people}))
    new.replace(folder / "people.yaml")


def person(name: str, tag: int, port: object = None) -> dict[str, object]:
    entry: dict[str, object] = {"name": name, "tag_id": tag, "height_m": 1.75}
    return entry | ({"n100": {"port": str(port)}} if port else {})


def position_m(at_s: float) -> tuple[float, float]:
    """Where the walker is, in the map."""
    angle = _angle(at_s)
    return 10.0 + RADIUS_M * math.cos(angle), 10.0 + RADIUS_M * math.sin(angle)


def ranging(at_s: float, number: int, tag: int = WALKER_TAG) -> RangingRound:
    """The round the tag makes at an instant; device time counts from a power-up 100 s before."""
    place = (*position_m(at_s), TAG_HEIGHT_M)
    ranges = tuple(Range(anchor, math.dist(place, position)) for anchor, position in ANCHORS.items())
    return RangingRound(tag, 1, number, device_us(at_s), ranges, corrected=True)


def device_us(at_s: float) -> int:
    return round((at_s + 100.0) * 1e6)


def frame(message: RangingRound, number: int) -> bytes:
    return encode_frame(FrameType.RANGES, number, encode_ranges(message))


def imu_bytes(at_s: float, number: int) -> bytes:
    """A sample and its attitude in the device's axes (forward-right-down in north-east-down)."""
    walking = at_s > STANDING_S
    bounce = 2.5 * math.sin(math.tau * STEP_HZ * at_s) if walking else 0.0
    stride = math.pi * STEP_HZ * at_s
    sway, roll = (SWAY_M_S2 * math.sin(stride), ROLL_RAD_S * math.cos(stride)) if walking else (0.0, 0.0)
    rate = (roll, 0.0, -SPEED_M_S / RADIUS_M if walking else 0.0)
    heading = -_angle(at_s)  # walking north at the start, turning left
    attitude = (math.cos(heading / 2.0), 0.0, 0.0, math.sin(heading / 2.0))
    ahrs = AhrsFrame(rate, (0.0, 0.0, heading % math.tau), attitude, device_us(at_s))
    imu = ImuFrame(rate, (0.0, sway, -9.80665 - bounce), (200.0, 0.0, 400.0), 25.0, 101325.0, 25.0, device_us(at_s))
    return encode(ahrs, 2 * number % 256) + encode(imu, (2 * number + 1) % 256)


def _angle(at_s: float) -> float:
    return max(0.0, at_s - STANDING_S) * SPEED_M_S / RADIUS_M


class LiveWalker:
    """Plays the walker into two lines in real time. Every seventh round reaches the line 60 ms late."""

    LATE_S = 0.06

    def __init__(self, uwb: PseudoSerial, n100: PseudoSerial) -> None:
        self.uwb, self.n100 = uwb, n100
        self._stop = threading.Event()
        self.start_s = time.monotonic()
        self.start_ns = time.time_ns()
        self._threads = [threading.Thread(target=play, daemon=True) for play in (self._play_uwb, self._play_n100)]

    def start(self) -> None:
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        self._stop.set()
        for thread in self._threads:
            thread.join()

    def stamp_ns(self, device_ticks: int) -> int:
        """The true instant, in ROS time, of what the device counted at these ticks."""
        return self.start_ns + device_ticks * 1000 - 100 * 10**9

    def position_at(self, stamp_ns: int) -> tuple[float, float]:
        return position_m((stamp_ns - self.start_ns) / 1e9)

    def _play_uwb(self) -> None:
        for number, at_s in self._instants(ROUND_PERIOD_S, late=lambda k: self.LATE_S if k % 7 == 6 else 0.0):
            self.uwb.write(frame(ranging(at_s, number), number))

    def _play_n100(self) -> None:
        for number, at_s in self._instants(SAMPLE_PERIOD_S, late=lambda _: 0.0):
            self.n100.write(imu_bytes(at_s, number))

    def _instants(self, period_s: float, late: object) -> Iterator[tuple[int, float]]:
        number = 0
        while not self._stop.wait(max(0.0, self.start_s + number * period_s + late(number) - time.monotonic())):
            yield number, number * period_s
            number += 1


@contextlib.contextmanager
def live_walker(folder: Path) -> Iterator[LiveWalker]:
    """The walker on two pseudo-terminals `uwb` and `n100` in a folder."""
    walker = LiveWalker(PseudoSerial(folder / "uwb"), PseudoSerial(folder / "n100"))
    walker.start()
    try:
        yield walker
    finally:
        walker.stop()
