from itertools import pairwise

import pytest

from mine_loc_uwb.wire.starting import ShellStarter, SilentStarter, TlvPoller, make_starter

SECOND = 1_000_000_000
STEP = SECOND // 20


class Tag:
    """A DWM1001 as seen from its serial line: a shell that two CRs wake, in which `lec` switches the stream."""

    def __init__(self, *, streaming=False, deaf=False):
        self.streaming, self.deaf, self.awake = streaming, deaf, False
        self.received = b""

    def write(self, data):
        self.received += data
        if self.deaf or not data:
            return b""
        if data == b"\r\r":
            self.awake = True
            return b"\r\n\r\ndwm> "
        if self.awake and data == b"lec\r":
            self.streaming = not self.streaming
            return b"lec\r\ndwm> "
        return b""


def run(starter, tag, seconds, *, decodable=True):
    for now_ns in range(0, int(seconds * SECOND), STEP):
        if tag.streaming:
            starter.observe(b"DIST,1,AN0,022E,7.94,8.03,0.00,3.44\r\n")
        starter.observe(tag.write(starter.poll(now_ns, stream_alive=tag.streaming and decodable)))


def test_a_silent_tag_is_woken_and_started_once():
    tag = Tag()
    run(ShellStarter(), tag, 60)
    assert tag.received == b"\r\rlec\r"
    assert tag.streaming


@pytest.mark.parametrize("decodable", [True, False])
def test_a_running_stream_is_never_switched_off(decodable):
    tag = Tag(streaming=True)
    run(ShellStarter(), tag, 60, decodable=decodable)
    assert tag.received == b""


def test_nothing_is_written_before_a_while_of_silence():
    starter = ShellStarter()
    written = [starter.poll(now, stream_alive=False) for now in range(0, ShellStarter.LISTEN_NS, STEP)]
    assert set(written) == {b""}
    assert starter.poll(ShellStarter.LISTEN_NS, stream_alive=False) == b"\r\r"


def test_a_stream_that_stops_is_started_again():
    starter, tag = ShellStarter(), Tag(streaming=True)
    run(starter, tag, 5)
    tag.streaming = False
    run(starter, tag, 30)
    assert tag.received == b"\r\rlec\r"


def test_a_deaf_device_gets_no_command_only_repeated_wakes():
    tag = Tag(deaf=True)
    run(ShellStarter(), tag, 20)
    assert tag.received.count(b"\r\r") > 3
    assert b"lec" not in tag.received


def test_a_prompt_heard_without_asking_starts_nothing():
    starter = ShellStarter()
    starter.observe(b"dwm> ")
    assert starter.poll(0, stream_alive=False) == b""


def test_binary_mode_is_polled_at_most_every_50_ms():
    poller = TlvPoller()
    asked = [now for now in range(0, SECOND, 1_000_000) if poller.poll(now, stream_alive=True)]
    assert len(asked) == 10
    assert min(b - a for a, b in pairwise(asked)) >= 50_000_000
    assert poller.poll(2 * SECOND, stream_alive=False) == b"\x0c\x00"


def test_each_format_has_its_starter():
    assert isinstance(make_starter("dwm1001_shell"), ShellStarter)
    assert isinstance(make_starter("dwm1001_tlv"), TlvPoller)
    for name in ("trek1000", "arduino", "mine_loc", "auto"):
        assert isinstance(make_starter(name), SilentStarter)
    assert SilentStarter().poll(0, stream_alive=False) == b""
