"""Lines that vanish and come back: a pty under another name, a TCP bridge restarted, a port that is not there yet."""

import contextlib
import os
import socket
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from graph.observer import Heard, Observer
from graph.processes import Running, node_command, running
from graph.walker import imu_bytes, ranging
from mine_loc_interfaces.msg import UwbRangeArray
from sensor_msgs.msg import Imu

from mine_loc_core.nodes.qos import STREAM
from mine_loc_uwb.wire.trek1000 import encode_round

pytestmark = pytest.mark.graph

OK, ERROR = 0, 2


class Pty:
    """A USB serial adapter: plugged in again it gets another name of the same pattern, as /dev/ttyACM0 and 1."""

    def __init__(self, folder: Path) -> None:
        self.pattern = folder / "ttyACM*"
        self._folder = folder
        self._plugged = 0
        self._ends: tuple[int, int] | None = None

    def plug_in(self) -> None:
        self._ends = os.openpty()
        tty.setraw(self._ends[1])
        os.set_blocking(self._ends[0], False)
        self._name().symlink_to(os.ttyname(self._ends[1]))

    def unplug(self) -> None:
        self._name().unlink()
        for end in self._ends or ():
            os.close(end)
        self._ends = None
        self._plugged += 1

    def write(self, data: bytes) -> None:
        if self._ends:
            with contextlib.suppress(BlockingIOError):
                os.write(self._ends[0], data)

    def _name(self) -> Path:
        return self._folder / f"ttyACM{self._plugged}"


class TcpBridge:
    """An ESP8266 in raw TCP mode: accepts one client; gone, it refuses."""

    def __init__(self) -> None:
        with socket.create_server(("127.0.0.1", 0)) as probe:
            self.port = probe.getsockname()[1]
        self._server: socket.socket | None = None
        self._client: socket.socket | None = None

    def plug_in(self) -> None:
        self._server = socket.create_server(("127.0.0.1", self.port))
        self._server.setblocking(False)

    def unplug(self) -> None:
        for end in (self._client, self._server):
            if end:
                end.close()
        self._client = self._server = None

    def write(self, data: bytes) -> None:
        with contextlib.suppress(OSError):
            if self._server and not self._client:
                self._client = self._server.accept()[0]
            if self._client:
                self._client.sendall(data)


class Device:
    """Sends a message every period into a line, as long as somebody waits."""

    def __init__(self, line: Any, period_s: float, encode: Callable[[float, int], bytes]) -> None:
        self._line = line
        self._period_s = period_s
        self._encode = encode
        self._start_s = time.monotonic()
        self._sent = 0

    def send(self) -> None:
        while self._sent * self._period_s < time.monotonic() - self._start_s:
            self._sent += 1
            self._line.write(self._encode(self._sent * self._period_s, self._sent))


def trek_line(at_s: float, number: int) -> bytes:
    message = ranging(at_s, number % 256, tag=1)
    return encode_round(type(message)(1, 1, number % 256, round(at_s * 1e3), message.ranges[:4], corrected=True))


class Bench:
    """A driver on a line, and what is heard of it."""

    def __init__(self, observer: Observer, run: Running, device: Device, heard: Heard, health: str) -> None:
        self.run, self._observer, self._device, self._heard, self._health = run, observer, device, heard, health

    def wait_for(self, happened: Callable[[], Any], deadline_s: float, what: str) -> float:
        def seen() -> Any:
            self._device.send()
            return happened()

        return self._observer.wait_for(seen, deadline_s, what)

    def level_is(self, level: int) -> bool:
        return self._observer.level(self._health) == level

    def reads_again(self) -> Callable[[], bool]:
        before = len(self._heard)
        return lambda: len(self._heard) > before + 3


@pytest.fixture
def adapter(tmp_path) -> Pty:
    return Pty(tmp_path)


@pytest.fixture
def bridge() -> Iterator[TcpBridge]:
    bridge = TcpBridge()
    yield bridge
    bridge.unplug()


@pytest.fixture
def uwb_bench(adapter, observer, domain, tmp_path) -> Iterator[Bench]:
    parameters = {"port": adapter.pattern, "format": "trek1000"}
    heard = observer.listen(UwbRangeArray, "uwb/ranges")
    with running(node_command("mine_loc_uwb.nodes.dwm1000_driver", parameters), domain, tmp_path / "log") as run:
        yield Bench(observer, run, Device(adapter, 0.1, trek_line), heard, "dwm1000_driver: port")


def imu_bench(observer: Observer, domain: int, log: Path, port: object, line: Any) -> contextlib.AbstractContextManager:
    @contextlib.contextmanager
    def bench() -> Iterator[Bench]:
        command = node_command("mine_loc_pdr.nodes.n100_driver", {"person": "walker", "port": port}, "/walker")
        heard = observer.listen(Imu, "walker/imu/data", STREAM)
        with running(command, domain, log) as run:
            yield Bench(observer, run, Device(line, 0.01, imu_bytes), heard, "walker/n100_driver: serial line")

    return bench()


@pytest.fixture
def imu_pty_bench(adapter, observer, domain, tmp_path) -> Iterator[Bench]:
    with imu_bench(observer, domain, tmp_path / "log", adapter.pattern, adapter) as bench:
        yield bench


@pytest.fixture
def imu_tcp_bench(bridge, observer, domain, tmp_path) -> Iterator[Bench]:
    with imu_bench(observer, domain, tmp_path / "log", f"socket://127.0.0.1:{bridge.port}", bridge) as bench:
        yield bench


@pytest.mark.parametrize(
    ("bench", "line"), [("uwb_bench", "adapter"), ("imu_pty_bench", "adapter"), ("imu_tcp_bench", "bridge")]
)
def test_a_line_may_be_missing_come_go_and_come_back(bench, line, request):
    line, bench = request.getfixturevalue(line), request.getfixturevalue(bench)
    bench.wait_for(lambda: bench.level_is(ERROR), 20.0, "the error of a port that is not there")
    assert bench.run.alive
    line.plug_in()
    first_s = bench.wait_for(bench.reads_again(), 5.0, "messages of a line that appeared")
    bench.wait_for(lambda: bench.level_is(OK), 5.0, "good diagnostics")

    line.unplug()
    noticed_s = bench.wait_for(lambda: bench.level_is(ERROR), 2.0, "the error of an unplugged line")
    line.plug_in()
    resumed_s = bench.wait_for(bench.reads_again(), 5.0, "messages of a line plugged in again")
    bench.wait_for(lambda: bench.level_is(OK), 5.0, "good diagnostics again")
    print(f"read after {first_s:.2f} s, error after {noticed_s:.2f} s, resumed after {resumed_s:.2f} s")


@pytest.mark.parametrize(("bench", "line"), [("uwb_bench", "adapter"), ("imu_tcp_bench", "bridge")])
def test_a_line_that_falls_silent_is_an_error_within_two_seconds(bench, line, request, observer):
    """A device that lost power closes nothing."""
    line, bench = request.getfixturevalue(line), request.getfixturevalue(bench)
    line.plug_in()
    bench.wait_for(lambda: bench.level_is(OK), 20.0, "good diagnostics")
    observer.wait_for(lambda: bench.level_is(ERROR), 2.0, "the error of a silent line")
