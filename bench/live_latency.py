"""From the bytes of a round on the pseudo-terminal to the fused pose of that round in another process."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from live_feeder import Fed
from live_watch import Seen
from numpy.typing import NDArray

from mine_loc_core.stamps import NS_PER_MS, NS_PER_S

_SAME_NS = NS_PER_MS // 2
_LONGEST_NS = NS_PER_S


@dataclass(frozen=True, slots=True)
class Latencies:
    """Latency of each answered round [ms], rounds written, and the shares no driver published and no pose answered."""

    latency_ms: NDArray[np.float64]
    rounds: int
    unheard_share: float
    unanswered_share: float

    def percentile_ms(self, percent: float) -> float:
        """Of all rounds: those without an answer count as never."""
        missing = np.full(self.rounds - len(self.latency_ms), np.inf)
        return float(np.percentile(np.concatenate([self.latency_ms, missing]), percent, method="higher"))


def latencies(fed: Fed, seen: Seen, warm_up_s: float) -> Latencies:
    """Of the rounds written `warm_up_s` after the start and later.

    A pose answers a round when it has the round's stamp, or says that its newest UWB measurement has it: a pose between
    rounds may have been published with a later stamp already, and stamps never go back.
    """
    from_ns = fed.start_ns + round(warm_up_s * NS_PER_S)
    written = {key: at_ns for key, at_ns in fed.written_ns.items() if at_ns >= from_ns}
    answers = {tag: _Answers(poses) for tag, poses in seen.poses.items()}
    found = []
    for (tag_id, seq), at_ns in written.items():
        stamp_ns = seen.stamps_ns.get((tag_id, seq))
        came_ns = None if stamp_ns is None or tag_id not in answers else answers[tag_id].to(stamp_ns)
        if came_ns is not None:
            found.append((came_ns - at_ns) / NS_PER_MS)
    unheard = sum(key not in seen.stamps_ns for key in written)
    count = max(len(written), 1)
    return Latencies(np.array(found, dtype=np.float64), len(written), unheard / count, 1.0 - len(found) / count)


class _Answers:
    """Poses of one tag by what they answer."""

    def __init__(self, poses: list[tuple[int, int, int]]) -> None:
        self._first: dict[int, list[tuple[int, int]]] = {}
        for stamp_ns, measured_ns, came_ns in poses:
            for each_ns in {stamp_ns, measured_ns}:
                self._first.setdefault(each_ns // NS_PER_MS, []).append((each_ns, came_ns))

    def to(self, stamp_ns: int) -> int | None:
        """When the first pose came that rests on the round of this stamp."""
        near = [
            came_ns
            for slot in range((stamp_ns - _SAME_NS) // NS_PER_MS, (stamp_ns + _SAME_NS) // NS_PER_MS + 1)
            for each_ns, came_ns in self._first.get(slot, ())
            if abs(each_ns - stamp_ns) <= _SAME_NS
        ]
        return min(near, default=None)


def stage_table(fed: Fed, seen: Seen, warm_up_s: float) -> Mapping[str, Mapping[str, float]]:
    """Percentiles [ms] of the time from the bytes to the last message of a round on each topic watched."""
    from_ns = fed.start_ns + round(warm_up_s * NS_PER_S)
    table = {}
    for topic, came_ns in seen.arrivals_ns.items():
        late_ms = [
            (came_ns[tag_id, stamp_ns] - at_ns) / NS_PER_MS
            for (tag_id, seq), at_ns in fed.written_ns.items()
            if at_ns >= from_ns
            and (stamp_ns := seen.stamps_ns.get((tag_id, seq))) is not None
            and (tag_id, stamp_ns) in came_ns
        ]
        if late_ms:
            table[topic] = {f"p{percent}": float(np.percentile(late_ms, percent)) for percent in (10, 50, 99)}
    return table
