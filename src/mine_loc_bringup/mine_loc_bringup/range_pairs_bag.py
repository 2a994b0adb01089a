"""Pairs of measured and true range from a bag that `mine-loc simulate --bag` wrote, or any with the same topics.

Ranges come from uwb/ranges, tags' true places from truth/<person>/pose, the links' classes from truth/link_state, and
the anchors' places and offsets from site.yaml.
"""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from mine_loc_bringup.bag_messages import open_bag
from mine_loc_bringup.message_types import workspace_types
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.people import load_people
from mine_loc_core.site import Site, load_site
from mine_loc_core.stamps import NS_PER_S, to_stamp_ns
from mine_loc_sim.scene import anchor_places_m
from mine_loc_uwb.range_pairs import RangePairs, joined
from mine_loc_uwb.stamp_latency import StampLatency, TimedRanges, common_latency_s, fit_stamp_latency

_MOST_RANGES = 200_000
_SAME_EXCHANGE_NS = NS_PER_S // 50
_GROUP_NS = 5 * NS_PER_S
_NO_LINE_OF_SIGHT = {1, 2}  # classes of mine_loc_interfaces/LinkState


@dataclass(slots=True)
class _Tag:
    """What a bag holds of one tag: rows of (stamp, anchor, range, power), (stamp, place), (stamp, class) by anchor."""

    ranges: list[tuple[int, int, float, float]] = field(default_factory=list)
    track: list[tuple[int, float, float, float]] = field(default_factory=list)
    classes: dict[int, list[tuple[int, bool]]] = field(default_factory=lambda: defaultdict(list))


def read_bag(bag: Path, site_folder: Path) -> tuple[RangePairs, list[StampLatency]]:
    """Pairs of all tags at the instants that their common stamp latency gives, and the latency of each.

    Pairs of 5 s of one tag form a group. A tag that hardly moves has no latency of its own. Raises
    ConfigurationError for a bag that cannot be read or in which a topic is missing.
    """
    site = load_site(site_folder)
    tag_of = {person.name: person.tag_id for person in load_people(site_folder) if person.tag_id}
    tags: dict[int, _Tag] = defaultdict(_Tag)
    types = workspace_types()
    with open_bag(bag) as messages:
        for each in messages.read(set(messages.topics)):
            _take(each.topic, lambda m=each: types.deserialize_cdr(m.data, m.type_name), tags, tag_of)
    surveys = [_survey(tag, site) for tag in tags.values() if tag.ranges and len(tag.track) > 1]
    latencies = [each for each in map(_latency, surveys) if each is not None]
    pairs = [_pairs(survey, common_latency_s(latencies)) for survey in surveys]
    if not sum(map(len, pairs)):
        wanted = "uwb/ranges, truth/<person>/pose and truth/link_state of people in people.yaml"
        raise ConfigurationError(f"{bag}: no pair of measured and true range; allowed: a bag with {wanted}")
    return joined(pairs), latencies


def _take(topic: str, read: Any, tags: dict[int, _Tag], tag_of: Mapping[str, int]) -> None:
    words = topic.strip("/").split("/")
    if words == ["uwb", "ranges"]:
        message = read()
        stamp_ns = to_stamp_ns(message.header.stamp)
        rows = tags[message.tag_id].ranges
        if len(rows) < _MOST_RANGES:
            rows += [(stamp_ns + r.stamp_offset_ns, r.anchor_id, r.range_raw, r.receive_power) for r in message.ranges]
    elif words == ["truth", "link_state"]:
        message = read()
        hidden = message.most_likely_class in _NO_LINE_OF_SIGHT
        tags[message.tag_id].classes[message.anchor_id].append((to_stamp_ns(message.header.stamp), hidden))
    elif len(words) == 3 and words[0] == "truth" and words[2] == "pose" and words[1] in tag_of:
        message = read()
        place = message.pose.position
        tags[tag_of[words[1]]].track.append((to_stamp_ns(message.header.stamp), place.x, place.y, place.z))


@dataclass(frozen=True, slots=True, eq=False)
class _Survey:
    """Ranges (n,) of one tag and its track; `known`: the link's class is known, `nlos`: it has no line of sight."""

    ranges: TimedRanges
    known: npt.NDArray[np.bool_]
    nlos: npt.NDArray[np.bool_]
    receive_power_dbm: npt.NDArray[np.float64]


def _survey(tag: _Tag, site: Site) -> _Survey:
    number = {anchor.id: index for index, anchor in enumerate(site.anchors)}
    rows = [row for row in tag.ranges if row[1] in number and np.isfinite(row[2])]
    anchor = np.array([number[row[1]] for row in rows], np.int64)
    offset_m = np.array([each.range_offset_m for each in site.anchors])
    track = sorted(tag.track)
    ranges = TimedRanges(
        stamp_ns=np.array([row[0] for row in rows], np.int64),
        range_m=np.array([row[2] for row in rows], np.float64) - offset_m[anchor],
        anchor=anchor,
        anchor_m=anchor_places_m(site)[anchor],
        track_ns=np.array([row[0] for row in track], np.int64),
        track_m=np.array([row[1:] for row in track], np.float64),
    )
    known, nlos = _labels(tag, [row[:2] for row in rows])
    return _Survey(ranges, known, nlos, np.array([row[3] for row in rows], np.float64))


def _pairs(survey: _Survey, latency_s: float) -> RangePairs:
    ranges = survey.ranges
    true_m = ranges.range_m - ranges.residual_m(latency_s)
    group = (ranges.stamp_ns - ranges.stamp_ns.min(initial=2**62)) // _GROUP_NS
    pairs = RangePairs(ranges.range_m, true_m, survey.nlos, survey.receive_power_dbm, group)
    return pairs.only(survey.known & np.isfinite(true_m))


def _latency(survey: _Survey) -> StampLatency | None:
    """From links in line of sight: a body shadows whom it walks away from, which looks like stamps that are early."""
    try:
        return fit_stamp_latency(survey.ranges.only(survey.known & ~survey.nlos))
    except ConfigurationError:
        return None


def _labels(tag: _Tag, exchanges: list[tuple[int, int]]) -> tuple[npt.NDArray[np.bool_], npt.NDArray[np.bool_]]:
    """Whether the class of each exchange (stamp, anchor) is known, and whether it has no line of sight."""
    tables = {anchor: sorted(rows) for anchor, rows in tag.classes.items()}
    stamps = {anchor: np.array([row[0] for row in rows], np.int64) for anchor, rows in tables.items()}
    known, nlos = np.zeros(len(exchanges), bool), np.zeros(len(exchanges), bool)
    for index, (stamp_ns, anchor) in enumerate(exchanges):
        if anchor not in tables:
            continue
        after = int(np.searchsorted(stamps[anchor], stamp_ns))
        near = [each for each in (after - 1, after) if 0 <= each < len(tables[anchor])]
        best = min(near, key=lambda each: abs(tables[anchor][each][0] - stamp_ns))
        known[index] = abs(tables[anchor][best][0] - stamp_ns) <= _SAME_EXCHANGE_NS
        nlos[index] = tables[anchor][best][1]
    return known, nlos
