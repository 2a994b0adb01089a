"""Accumulator windows of one ranging round, put together: one message a round is cheap, one a link is not."""

import math
from collections import OrderedDict
from collections.abc import Iterator
from dataclasses import dataclass

from mine_loc_uwb.ranging import CirWindow, Message, RangingRound

MOST_WINDOWS = 64
"""Of one round that are passed on together."""
_REMEMBERED_TAGS = 256

Gathered = Message | tuple[CirWindow, ...]
"""What a line says, windows never alone but with those of their tag and round."""


@dataclass(slots=True)
class _Round:
    """The newest round of a tag."""

    seq: int | None
    links: int
    expected: int
    """Windows, as many as links less those that did not come in the round before: not every device sends all."""
    come: int = 0


class WindowGatherer:
    """Takes the messages of one line in order; the order of all else stays."""

    def __init__(self) -> None:
        self._rounds: OrderedDict[int, _Round] = OrderedDict()
        self._open: list[CirWindow] = []

    def take(self, message: Message) -> Iterator[Gathered]:
        """What can be passed on now: windows when their round has all it is expected to have, or something follows."""
        if not isinstance(message, CirWindow):
            yield from self.release()
            if isinstance(message, RangingRound):
                self._begin(message)
            yield message
            return
        if self._open and _round_of(self._open[0]) != _round_of(message):
            yield from self.release()
        self._open.append(message)
        if self._whole(message) or len(self._open) == MOST_WINDOWS:
            yield from self.release()

    def release(self) -> Iterator[Gathered]:
        """What is there of a round that is not whole."""
        if self._open:
            windows, self._open = tuple(self._open), []
            yield windows

    def reset(self) -> None:
        """The line was interrupted."""
        self._rounds.clear()
        self._open.clear()

    def _whole(self, newest: CirWindow) -> bool:
        of_round = self._rounds.get(newest.tag_id)
        if of_round is None or of_round.seq != newest.seq:
            return False
        of_round.come += 1
        return of_round.come >= of_round.expected

    def _begin(self, ranging: RangingRound) -> None:
        links = sum(math.isfinite(each.range_m) for each in ranging.ranges)
        before = self._rounds.pop(ranging.tag_id, None)
        missing = max(before.links - before.come, 0) if before is not None and before.come else 0
        self._rounds[ranging.tag_id] = _Round(ranging.seq, links, max(links - missing, 1))
        if len(self._rounds) > _REMEMBERED_TAGS:
            self._rounds.popitem(last=False)


def _round_of(window: CirWindow) -> tuple[int, int]:
    return window.tag_id, window.seq
