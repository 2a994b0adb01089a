"""The faults of the replay tests, each a transformation of a bag's messages (and of its site).

The bag is `walk`: one person with ranges at 10 Hz and an IMU for 45 s. Times are seconds since its beginning. A message
has two times, that of its recording (when it arrived) and the stamp in its header (when it was measured); a fault says
which it touches.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from mine_loc_bringup.bag_messages import BagMessage
from mine_loc_bringup.message_types import workspace_types
from mine_loc_bringup.topic_mapping import adapt
from mine_loc_core.stamps import NS_PER_S

Messages = list[BagMessage]
Fault = Callable[[Messages], Iterable[BagMessage]]
RANGES, IMU, REGIONS = "/uwb/ranges", "/fitter/imu/data", "/coarse/regions"
REGION_ARRAY = "mine_loc_interfaces/msg/CoarseRegionArray"
_TYPES = workspace_types()


# How faults are written.


def seconds(message: BagMessage, first: BagMessage) -> float:
    """When a message was recorded."""
    return (message.log_ns - first.log_ns) / NS_PER_S


def changed(message: BagMessage, change: Callable[[Any], None]) -> BagMessage:
    """The message with its content changed."""
    content = _TYPES.deserialize_cdr(message.data, message.type_name)
    change(content)
    return replace(message, data=bytes(_TYPES.serialize_cdr(content, message.type_name)))


def delayed(message: BagMessage, by_ns: int) -> BagMessage:
    """Recorded so much later, with the same stamp."""
    return replace(message, log_ns=message.log_ns + by_ns)


def stamped_later(message: BagMessage, by_ns: int) -> BagMessage:
    """Stamped so much later, recorded at the same time."""

    def change(content: Any) -> None:
        stamp = content.header.stamp
        stamp.sec, stamp.nanosec = divmod(stamp.sec * NS_PER_S + stamp.nanosec + by_ns, NS_PER_S)

    return changed(message, change)


def shifted(message: BagMessage, by_ns: int) -> BagMessage:
    """Measured and recorded so much later."""
    return stamped_later(delayed(message, by_ns), by_ns)


def each_range(message: BagMessage, change: Callable[[Any], None]) -> BagMessage:
    """The round with each of its ranges changed."""
    return changed(message, lambda content: [change(item) for item in content.ranges])


def between(start_s: float, stop_s: float, topic: str, change: Callable[[BagMessage], BagMessage | None]) -> Fault:
    """A change of one topic's messages for a while; None drops one."""

    def fault(messages: Messages) -> Iterator[BagMessage]:
        for message in messages:
            inside = message.topic == topic and start_s <= seconds(message, messages[0]) < stop_s
            if (left := change(message) if inside else message) is not None:
                yield left

    return fault


def ordered(messages: Iterable[BagMessage]) -> Messages:
    """In the order of recording."""
    return sorted(messages, key=lambda message: message.log_ns)


# The faults, by name.


def none(messages: Messages) -> Messages:
    """The bag as it is."""
    return messages


def bag_loop(messages: Messages) -> Messages:
    """The bag starts over: all times jump back."""
    return messages + messages


def forward_jump(messages: Messages) -> Iterator[BagMessage]:
    """From 20 s on everything happens an hour later."""
    for message in messages:
        late = seconds(message, messages[0]) >= 20.0
        yield shifted(message, 3600 * NS_PER_S) if late else message


def silence(messages: Messages) -> Iterator[BagMessage]:
    """For 20 s, beginning at 20 s, nothing is measured or recorded; time passes."""
    for message in messages:
        late = seconds(message, messages[0]) >= 20.0
        yield shifted(message, 20 * NS_PER_S) if late else message


def duplicate_stamp(messages: Messages) -> Iterator[BagMessage]:
    """Every round comes twice."""
    for message in messages:
        yield message
        if message.topic == RANGES:
            yield message


def future_stamp(messages: Messages) -> Iterator[BagMessage]:
    """Every tenth round is stamped ten seconds ahead."""
    rounds = 0
    for message in messages:
        rounds += message.topic == RANGES
        wrong = message.topic == RANGES and rounds % 10 == 0
        yield stamped_later(message, 10 * NS_PER_S) if wrong else message


def _skewed(ppm: float) -> Fault:
    def fault(messages: Messages) -> Iterator[BagMessage]:
        for message in messages:
            measured = message.topic in {RANGES, IMU}
            drift_ns = round((message.log_ns - messages[0].log_ns) * ppm * 1e-6)
            yield stamped_later(message, drift_ns) if measured else message

    return fault


skew_fast = _skewed(50.0)
"""Stamps gain 50 ppm on the recorder's clock."""
skew_slow = _skewed(-50.0)
"""Stamps lose 50 ppm."""
clock_step = between(20.0, 25.0, RANGES, lambda message: stamped_later(message, -NS_PER_S // 2))
"""For 5 s the stamps of the ranges are half a second old."""


def _keeping(heard: Callable[[int], bool]) -> Callable[[BagMessage], BagMessage]:
    """Only the ranges to anchors that are heard."""

    def drop(content: Any) -> None:
        content.ranges = [item for item in content.ranges if heard(item.anchor_id)]

    return lambda message: changed(message, drop)


anchors_off_on = between(15.0, 25.0, RANGES, _keeping(lambda anchor_id: anchor_id not in {257, 259}))
"""Two anchors fall silent for 10 s and come back."""
single_anchor = between(15.0, 35.0, RANGES, _keeping(lambda anchor_id: anchor_id == 260))
"""A corridor in which one anchor is heard, for 20 s."""


def _longer(by_m: float) -> Callable[[BagMessage], BagMessage]:
    def change(item: Any) -> None:
        item.range += by_m
        item.range_raw += by_m

    return lambda message: each_range(message, change)


all_nlos = between(20.0, 25.0, RANGES, _longer(2.5))
"""For 5 s every range is 2.5 m too long."""
wrong_start = between(0.0, 2.0, RANGES, _longer(8.0))
"""The first 2 s of ranges, on which the estimate begins, are 8 m too long."""
imu_drop = between(20.0, 22.0, IMU, lambda _: None)
"""No IMU for 2 s."""


def imu_halved(messages: Messages) -> Iterator[BagMessage]:
    """Every other sample of the IMU is lost."""
    samples = 0
    for message in messages:
        samples += message.topic == IMU
        if message.topic != IMU or samples % 2:
            yield message


def _set(name: str, *values: float) -> Callable[[BagMessage], BagMessage]:
    """The ranges of a round get these values in turn; those beyond stay."""

    def change(content: Any) -> None:
        for item, value in zip(content.ranges, values, strict=False):
            setattr(item, name, value)

    return lambda message: changed(message, change)


not_finite = between(20.0, 25.0, RANGES, _set("range", math.nan, math.inf, -math.inf))
"""For 5 s up to three ranges of a round are NaN, +Inf and -Inf."""
bad_variance = between(20.0, 25.0, RANGES, _set("range_variance", 0.0, -1.0, math.nan))
"""For 5 s up to three variances of a round are 0, negative and NaN."""


def indefinite_covariance(messages: Messages) -> Iterator[BagMessage]:
    """Before anything else a coarse region of the person comes whose covariance is none."""
    region = adapt(None, "mine_loc_interfaces/msg/CoarseRegion", _TYPES, {})
    region.person, region.status = "fitter", 1
    region.center.x, region.center.y, region.center.z = 20.0, 0.0, 0.0
    region.covariance[:] = (100.0, 500.0, 500.0, 100.0)
    array = adapt(None, REGION_ARRAY, _TYPES, {})
    array.header.stamp.sec, array.header.stamp.nanosec = divmod(messages[0].log_ns, NS_PER_S)
    array.header.frame_id = "map"
    array.regions = [region]
    yield BagMessage(messages[0].log_ns, REGIONS, REGION_ARRAY, bytes(_TYPES.serialize_cdr(array, REGION_ARRAY)))
    yield from messages


def slow_consumer(messages: Messages) -> Messages:
    """Rounds reach the nodes in bursts, once a second."""
    first_ns = messages[0].log_ns

    def held(message: BagMessage) -> BagMessage:
        return delayed(message, -(message.log_ns - first_ns) % NS_PER_S) if message.topic == RANGES else message

    return ordered(held(message) for message in messages)


# Faults of the site.


def mis_surveyed_anchor(site: Path) -> None:
    """One anchor stands 5 m from where the site file says."""
    file = site / "site.yaml"
    content = yaml.safe_load(file.read_text("utf-8"))
    content["anchors"][3]["position_m"][0] += 5.0
    file.write_text(yaml.safe_dump(content, sort_keys=False), "utf-8")


OF_SITE = {"mis_surveyed_anchor"}
NAMES = (
    "none",
    "bag_loop",
    "forward_jump",
    "silence",
    "duplicate_stamp",
    "future_stamp",
    "skew_fast",
    "skew_slow",
    "clock_step",
    "anchors_off_on",
    "single_anchor",
    "all_nlos",
    "wrong_start",
    "imu_drop",
    "imu_halved",
    "not_finite",
    "bad_variance",
    "indefinite_covariance",
    "slow_consumer",
    "mis_surveyed_anchor",
)
