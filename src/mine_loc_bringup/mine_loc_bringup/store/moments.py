"""Instants as people write them, ISO 8601 with a zone, and as the store counts them, nanoseconds since 1970."""

from datetime import UTC, datetime, timedelta

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.stamps import NS_PER_US

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def parse_moment(text: str, where: str) -> int:
    """The stamp [ns] of an instant. Raises ConfigurationError that names `where`."""
    allowed = "ISO 8601 with a zone, such as 2025-11-26T15:10:00+01:00 or 2025-11-26T14:10Z"
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        raise ConfigurationError(f"{where}: {text!r} is no instant; allowed: {allowed}") from None
    if moment.tzinfo is None:
        raise ConfigurationError(f"{where}: {text!r} has no time zone; allowed: {allowed}")
    return (moment - _EPOCH) // timedelta(microseconds=1) * NS_PER_US


def moment_text(stamp_ns: int) -> str:
    """An instant in UTC, to the millisecond."""
    moment = _EPOCH + timedelta(microseconds=stamp_ns // NS_PER_US)
    return moment.isoformat(timespec="milliseconds").replace("+00:00", "Z")


def parse_period(since: str, until: str) -> tuple[int, int]:
    """The stamps [ns] of --from and --to. Raises ConfigurationError where they are none, or the second is no later."""
    since_ns, until_ns = parse_moment(since, "--from"), parse_moment(until, "--to")
    if until_ns <= since_ns:
        raise ConfigurationError(f"--to: {until} is not after --from {since}; allowed: a later instant")
    return since_ns, until_ns
