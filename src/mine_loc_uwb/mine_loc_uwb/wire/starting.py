"""What a driver must write to a device before it speaks: pure state machines, fed with time and the bytes heard."""

from typing import Protocol

from mine_loc_core.stamps import NS_PER_MS, NS_PER_S
from mine_loc_uwb.wire.dwm1001_shell import PROMPT
from mine_loc_uwb.wire.dwm1001_tlv import LOCATION_REQUEST


class Starter(Protocol):
    """Says what to write to the device. `poll` is to be called every few tens of milliseconds."""

    def observe(self, data: bytes) -> None:
        """Take the bytes just read from the device."""

    def poll(self, now_ns: int, *, stream_alive: bool) -> bytes:
        """Return the bytes to write now; `stream_alive` = messages were decoded within the last second or so."""

    def reset(self) -> None:
        """Begin anew, after the link was reopened."""


class SilentStarter:
    """For devices that speak unasked, and for automatic detection, which must not write to an unknown device."""

    def observe(self, data: bytes) -> None:
        """Nothing depends on what the device says."""

    def poll(self, now_ns: int, *, stream_alive: bool) -> bytes:  # noqa: ARG002
        """Nothing is ever written."""
        return b""

    def reset(self) -> None:
        """There is no state."""


class TlvPoller:
    """Asks a DWM1001 in binary mode for its location once a period of 100 ms, the rate of its position updates."""

    PERIOD_NS = 100 * NS_PER_MS

    def __init__(self) -> None:
        self._next_ns: int | None = None

    def observe(self, data: bytes) -> None:
        """Replies do not pace the requests: one may be lost."""

    def poll(self, now_ns: int, *, stream_alive: bool) -> bytes:  # noqa: ARG002
        """Return a location request when one is due, never two closer than the period."""
        if self._next_ns is not None and now_ns < self._next_ns:
            return b""
        self._next_ns = now_ns + self.PERIOD_NS
        return LOCATION_REQUEST

    def reset(self) -> None:
        """Ask at once."""
        self._next_ns = None


class ShellStarter:
    """Starts the `lec` stream of a DWM1001: listen, wake the shell with two CRs, wait for its prompt, write `lec`.

    The same command stops a running stream, so it is never written before a while of silence, and after it a stream
    gets longer to appear than a device takes that must first find its anchors. A device that stays silent is tried
    again after a pause that doubles.
    """

    LISTEN_NS = 2 * NS_PER_S
    PROMPT_TIMEOUT_NS = 2 * NS_PER_S
    STREAM_TIMEOUT_NS = 10 * NS_PER_S
    MAX_LISTEN_NS = 32 * NS_PER_S

    WAKE = b"\r\r"
    START = b"lec\r"
    _STREAM_SIGNS = (b"DIST,", b"le_us=", b"POS,")

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Listen first, as to a device never heard."""
        self._heard = b""
        self._waiting_for_prompt = False
        self._listen_ns = self.LISTEN_NS
        self._deadline_ns: int | None = None

    def observe(self, data: bytes) -> None:
        """Take the bytes just read: a prompt, or signs of a stream too damaged to be decoded."""
        self._heard = (self._heard + data)[-4096:]

    def poll(self, now_ns: int, *, stream_alive: bool) -> bytes:
        """Return the bytes to write now."""
        streaming = stream_alive or any(sign in self._heard for sign in self._STREAM_SIGNS)
        prompted = PROMPT.rstrip() in self._heard
        if streaming:
            self.reset()
        if self._deadline_ns is None:
            self._deadline_ns = now_ns + self._listen_ns
        elif self._waiting_for_prompt and prompted:
            self._waiting_for_prompt = False
            self._listen_ns = min(2 * self._listen_ns, self.MAX_LISTEN_NS)
            self._deadline_ns = now_ns + max(self.STREAM_TIMEOUT_NS, self._listen_ns)
            self._heard = b""
            return self.START
        elif now_ns >= self._deadline_ns:
            self._waiting_for_prompt = True
            self._heard = b""
            self._deadline_ns = now_ns + max(self.PROMPT_TIMEOUT_NS, self._listen_ns)
            return self.WAKE
        return b""


def make_starter(format_name: str) -> Starter:
    """Return the starter for the decoder of that name; anything but the two DWM1001 formats speaks unasked."""
    if format_name == "dwm1001_shell":
        return ShellStarter()
    if format_name == "dwm1001_tlv":
        return TlvPoller()
    return SilentStarter()
