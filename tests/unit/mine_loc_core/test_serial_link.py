"""Serial lines that come, go and come back: pseudo-terminals and a TCP server."""

import os
import socket
import threading
import time
import tty

import pytest

from mine_loc_core.serial_link import SerialLink

PATIENCE_S = 10.0


class Line:
    """A pseudo-terminal under a name of our choice."""

    def __init__(self, port):
        self.port = port
        self.master, self._slave = os.openpty()
        tty.setraw(self._slave)
        port.unlink(missing_ok=True)
        port.symlink_to(os.ttyname(self._slave))

    def unplug(self):
        self.port.unlink(missing_ok=True)
        os.close(self._slave)
        os.close(self.master)


class Reader:
    """A link under test, with what it has read so far."""

    def __init__(self, port, **options):
        self.woken = threading.Event()
        self.link = SerialLink(str(port), 115200, clock=time.monotonic_ns, wake=self.woken.set, **options)
        self.chunks = []

    @property
    def data(self):
        return b"".join(chunk.data for chunk in self.chunks)

    def until(self, condition):
        """Wait for wake-ups until the condition holds."""
        deadline = time.monotonic() + PATIENCE_S
        while True:
            self.woken.clear()
            self.chunks += self.link.take()
            if condition():
                return
            assert time.monotonic() < deadline, self.link.status
            self.woken.wait(0.05)


@pytest.fixture
def open_link():
    readers = []

    def start(port, **options):
        readers.append(Reader(port, **options))
        readers[-1].link.start()
        return readers[-1]

    yield start
    for reader in readers:
        reader.link.stop()


def test_bytes_come_in_order_with_their_arrival_after_a_mark_of_the_new_connection(tmp_path, open_link):
    line = Line(tmp_path / "port")
    reader = open_link(line.port)
    reader.until(lambda: reader.link.status.port)
    os.write(line.master, b"one")
    reader.until(lambda: reader.data == b"one")
    os.write(line.master, b"two")
    reader.until(lambda: reader.data == b"onetwo")
    assert reader.chunks[0].data == b""
    arrivals = [chunk.arrival_ns for chunk in reader.chunks]
    assert arrivals == sorted(arrivals)
    status = reader.link.status
    assert (status.port, status.error, status.connections, status.bytes_read) == (str(line.port), "", 1, 6)
    line.unplug()


def test_a_line_that_is_not_there_is_named_and_waited_for(tmp_path, open_link):
    port = tmp_path / "port"
    reader = open_link(port)
    reader.until(lambda: str(port) in reader.link.status.error)
    assert reader.link.status.port == ""
    line = Line(port)
    reader.until(lambda: reader.link.status.connections == 1)
    line.unplug()


def test_a_cable_pulled_and_plugged_in_again_is_read_on(tmp_path, open_link):
    line = Line(tmp_path / "port")
    reader = open_link(line.port)
    reader.until(lambda: reader.link.status.port)
    line.unplug()
    reader.until(lambda: reader.link.status.port == "")
    assert reader.link.status.error
    line = Line(tmp_path / "port")
    reader.until(lambda: reader.link.status.connections == 2)
    os.write(line.master, b"again")
    reader.until(lambda: reader.data == b"again")
    assert [chunk.data for chunk in reader.chunks].count(b"") == 2
    line.unplug()


def test_a_device_that_comes_back_under_another_name_is_found_by_its_pattern(tmp_path, open_link):
    line = Line(tmp_path / "ttyACM0")
    reader = open_link(tmp_path / "ttyACM*")
    reader.until(lambda: reader.link.status.port == str(tmp_path / "ttyACM0"))
    line.unplug()
    line = Line(tmp_path / "ttyACM1")
    reader.until(lambda: reader.link.status.port == str(tmp_path / "ttyACM1"))
    os.write(line.master, b"here")
    reader.until(lambda: reader.data == b"here")
    line.unplug()


def test_a_port_that_cannot_be_a_serial_line_is_an_error_and_not_the_end(tmp_path, open_link):
    port = tmp_path / "port"
    port.write_text("a file")
    reader = open_link(port)
    reader.until(lambda: reader.link.status.error not in {"", "not opened yet"})
    port.unlink()
    line = Line(port)
    reader.until(lambda: reader.link.status.port)
    line.unplug()


def test_what_is_written_reaches_the_device(tmp_path, open_link):
    line = Line(tmp_path / "port")
    reader = open_link(line.port)
    reader.until(lambda: reader.link.status.port)
    reader.link.write(b"start\r")
    assert os.read(line.master, 100) == b"start\r"
    line.unplug()


def test_writing_to_a_line_that_is_down_is_harmless(tmp_path, open_link):
    reader = open_link(tmp_path / "nothing")
    reader.link.write(b"start\r")
    reader.until(lambda: "nothing" in reader.link.status.error)


def test_a_silent_line_is_closed_and_opened_again(tmp_path, open_link):
    line = Line(tmp_path / "port")
    reader = open_link(line.port, silence_s=0.3)
    reader.until(lambda: "silent for 0.3 s" in reader.link.status.error)
    reader.until(lambda: reader.link.status.connections >= 2)
    line.unplug()


def test_a_full_queue_drops_the_oldest_and_counts_it(tmp_path, open_link):
    line = Line(tmp_path / "port")
    reader = open_link(line.port)
    reader.until(lambda: reader.link.status.port)
    sent = 0
    deadline = time.monotonic() + PATIENCE_S
    while reader.link.status.bytes_dropped == 0:  # nobody takes; one chunk a write, each awaited
        assert time.monotonic() < deadline
        reader.woken.clear()
        os.write(line.master, bytes([sent % 256]))
        sent += 1
        reader.woken.wait(1.0)
    kept = b"".join(chunk.data for chunk in reader.link.take())
    status = reader.link.status
    assert len(kept) + status.bytes_dropped == status.bytes_read == sent
    assert kept == bytes(i % 256 for i in range(sent))[-len(kept) :]
    line.unplug()


def test_a_tcp_bridge_is_read_and_found_again_after_it_hung_up(open_link):
    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(PATIENCE_S)
        reader = open_link(f"socket://127.0.0.1:{server.getsockname()[1]}")
        for count, expected in enumerate((b"one", b"onetwo"), 1):
            bridge, _ = server.accept()
            with bridge:
                reader.until(lambda count=count: reader.link.status.connections == count)
                bridge.sendall(expected[-3:])
                reader.until(lambda expected=expected: reader.data == expected)
                reader.link.write(b"go")
                assert bridge.recv(2) == b"go"
            reader.until(lambda: "closed" in reader.link.status.error or reader.link.status.connections == 2)


def test_a_kind_of_port_that_cannot_be_waited_for_is_refused_with_a_reason(open_link):
    reader = open_link("loop://")
    reader.until(lambda: reader.link.status.connections >= 1 and reader.link.status.error)
    reader.until(lambda: reader.link.status.connections >= 2)


@pytest.mark.parametrize("there", [True, False])
def test_stop_closes_the_port_and_ends_the_reader(tmp_path, there):
    line = Line(tmp_path / "port") if there else None
    reader = Reader(tmp_path / "port")
    reader.link.start()
    reader.until(lambda: (reader.link.status.port != "") if there else ("no such port" in reader.link.status.error))
    reader.link.stop()
    assert reader.link.status.port == ""
    assert not [thread for thread in threading.enumerate() if thread.name == f"serial {tmp_path / 'port'}"]
    if line:
        line.unplug()


def test_a_link_that_was_never_started_can_be_stopped(tmp_path):
    Reader(tmp_path / "port").link.stop()
