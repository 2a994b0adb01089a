"""Coils and control lines, against a Modbus device on this host and pyserial's loop-back port."""

import os
import select
import socket
import threading
import time
import tty
from collections.abc import Iterator

import pytest
from graph.modbus_device import UNIT, ModbusDevice, modbus_device

from mine_loc_core.site import Relay
from mine_loc_fusion.relay_outputs import ControlLine, RelayError, make_output

TIMEOUT_S = 0.3


def relay(output: str, port: str, unit: int = UNIT, coils: tuple[int, ...] = (0, 3)) -> Relay:
    return Relay("brake", "car", output, port, 9600, unit, coils)


@pytest.fixture
def device() -> Iterator[ModbusDevice]:
    with modbus_device() as made:
        yield made


def tcp(device: ModbusDevice, **options) -> Relay:
    return relay("modbus_tcp", f"socket://127.0.0.1:{device.port}", **options)


def test_all_coils_named_and_no_others_are_switched(device):
    output = make_output(tcp(device), TIMEOUT_S)
    output.write(energised=True)
    assert [device.coil(number) for number in range(4)] == [True, False, False, True]
    output.write(energised=False)
    assert [device.coil(number) for number in range(4)] == [False] * 4
    output.close()


def test_a_device_that_goes_is_an_error_and_one_that_comes_back_is_found_again(device):
    output = make_output(tcp(device), TIMEOUT_S)
    output.write(energised=True)
    device.unplug()
    with pytest.raises(RelayError, match="closed"):
        output.write(energised=True)
    output.close()
    with pytest.raises(RelayError, match="cannot connect"):
        output.write(energised=True)
    device.plug_in()
    output.write(energised=False)
    assert not device.coil()
    output.close()


@pytest.mark.parametrize("options", [{"unit": UNIT + 1}, {"coils": (99,)}])
def test_an_answer_that_refuses_is_an_error(device, options):
    output = make_output(tcp(device, **options), TIMEOUT_S)
    with pytest.raises(RelayError, match="exception_code"):
        output.write(energised=True)
    output.close()


def test_a_device_that_accepts_and_never_answers_is_an_error_in_time():
    with socket.create_server(("127.0.0.1", 0)) as mute:
        output = make_output(relay("modbus_tcp", f"socket://127.0.0.1:{mute.getsockname()[1]}"), TIMEOUT_S)
        began_s = time.monotonic()
        with pytest.raises(RelayError):
            output.write(energised=True)
        assert time.monotonic() - began_s < 3 * TIMEOUT_S
        output.close()


@pytest.fixture
def serial_pair() -> Iterator[tuple[str, str]]:
    """Names of two pseudo-terminals with a wire between them."""
    (a, a_name), (b, b_name) = (raw_pty() for _ in range(2))
    ending = threading.Event()

    def carry() -> None:
        other = {a: b, b: a}
        while not ending.is_set():
            for end in select.select([a, b], [], [], 0.05)[0]:
                os.write(other[end], os.read(end, 4096))

    wire = threading.Thread(target=carry, daemon=True)
    wire.start()
    yield a_name, b_name
    ending.set()
    wire.join()


def raw_pty() -> tuple[int, str]:
    end, port = os.openpty()
    tty.setraw(port)
    return end, os.ttyname(port)


def test_modbus_rtu_on_a_serial_line(serial_pair):
    with modbus_device(serial_pair[1]) as device:
        output = make_output(relay("modbus_rtu", serial_pair[0]), TIMEOUT_S)
        output.write(energised=True)
        assert device.coil(0)
        assert device.coil(3)
        output.write(energised=False)
        assert not device.coil(0)
        device.unplug()
        with pytest.raises(RelayError):
            output.write(energised=True)
        output.close()


@pytest.mark.parametrize("line", ["dtr", "rts"])
def test_a_control_line_is_off_when_opened_and_follows(line):
    other = {"dtr": "rts", "rts": "dtr"}[line]
    output = ControlLine("loop://", line)
    output.write(energised=False)
    port = output._port
    assert (getattr(port, line), getattr(port, other)) == (False, False)
    output.write(energised=True)
    assert (getattr(port, line), getattr(port, other)) == (True, False)
    assert {"dtr": port.dsr, "rts": port.cts}[line]  # what the other end of the loop sees
    output.close()
    assert not port.is_open


def test_a_port_that_is_not_there_is_an_error():
    with pytest.raises(RelayError, match="nowhere"):
        make_output(relay("dtr", "/dev/nowhere"), TIMEOUT_S).write(energised=True)
    with pytest.raises(RelayError, match="cannot connect"):
        make_output(relay("modbus_rtu", "/dev/nowhere"), TIMEOUT_S).write(energised=True)
