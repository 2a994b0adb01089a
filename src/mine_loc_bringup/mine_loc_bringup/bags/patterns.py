"""Topics by pattern.

`*` stands for anything but a slash, `**` for anything. A pattern that begins with a slash is a whole name; another one
is the end of a name from a slash on, so that `uwb/ranges` is also `/section_2/uwb/ranges`.
"""

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

from mine_loc_core.errors import ConfigurationError

_ALLOWED = re.compile(r"/?(?:[\w*]+/)*[\w*]+")


@dataclass(frozen=True, slots=True)
class TopicPatterns:
    """Which topics are meant: those of `include` (all but hidden ones if empty) without those of `exclude`."""

    include: tuple[re.Pattern[str], ...]
    exclude: tuple[re.Pattern[str], ...]

    @classmethod
    def of(cls, include: Sequence[str], exclude: Sequence[str]) -> "TopicPatterns":
        """Raises ConfigurationError for a pattern that no topic can have."""
        return cls(tuple(map(_compiled, include)), tuple(map(_compiled, exclude)))

    def admits(self, topic: str) -> bool:
        """Whether a topic, by its full name, is meant."""
        hidden = "/_" in topic
        wanted = any(pattern.fullmatch(topic) for pattern in self.include) if self.include else not hidden
        return wanted and not any(pattern.fullmatch(topic) for pattern in self.exclude)


def unmatched(patterns: Iterable[str], topics: Collection[str]) -> list[str]:
    """The patterns that none of these topics is meant by."""
    return [each for each in patterns if not any(map(_compiled(each).fullmatch, topics))]


def split_list(text: str) -> list[str]:
    """The items of a list with commas between, as node parameters hold them."""
    return [item.strip() for item in text.split(",") if item.strip()]


def _compiled(pattern: str) -> re.Pattern[str]:
    if not _ALLOWED.fullmatch(pattern):
        raise ConfigurationError(
            f"topic pattern {pattern!r}; allowed: words of letters, digits, _ and * with slashes between"
        )
    words = re.escape(pattern).replace(r"\*\*", ".*").replace(r"\*", "[^/]*")
    return re.compile(words if pattern.startswith("/") else f".*/{words}")
