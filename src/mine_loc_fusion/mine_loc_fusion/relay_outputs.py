"""What holds a machine electrically: coils of a Modbus device, or a control line of a serial port. Off = stop.

Every call ends within the timeout given, and says by RelayError what went wrong.
"""

import inspect
import logging
import termios
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import serial
from pymodbus.client import ModbusSerialClient, ModbusTcpClient
from pymodbus.exceptions import ModbusException

from mine_loc_core.errors import MineLocError
from mine_loc_core.site import Relay

logging.getLogger("pymodbus").setLevel(logging.CRITICAL)  # a device that is away is reported once, by us

# The word for the address of a device was `slave` before pymodbus 3.10 (Ubuntu 24.04 has 3.6).
_UNIT = "device_id" if "device_id" in inspect.signature(ModbusTcpClient.write_coil).parameters else "slave"


class RelayError(MineLocError):
    """The output could not be set."""


class RelayOutput(Protocol):
    """One set of contacts, all the same way."""

    def write(self, *, energised: bool) -> None:
        """Set the contacts, connecting first if need be. Raises RelayError; then nothing is known of them."""

    def close(self) -> None:
        """Let go of the line; the next write connects anew."""


class ModbusCoils:
    """Coils of one device. `connect` makes a client that is not yet connected."""

    def __init__(self, make_client: Callable[[], Any], unit: int, coils: Sequence[int]) -> None:
        self._make_client, self._unit, self._coils = make_client, unit, tuple(coils)
        self._client: Any = None

    def write(self, *, energised: bool) -> None:
        """See RelayOutput; the device's answer to each write repeats it, else it counts as failed."""
        try:
            client = self._connected()
            for coil in self._coils:
                answer = client.write_coil(coil, energised, **{_UNIT: self._unit})
                if answer.isError():
                    raise RelayError(f"coil {coil}: {answer}")
        except (ModbusException, OSError, ValueError, termios.error) as error:
            raise RelayError(str(error)) from error

    def close(self) -> None:
        """See RelayOutput."""
        client, self._client = self._client, None
        if client is not None:
            client.close()

    def _connected(self) -> Any:
        if self._client is None:
            client = self._make_client()
            if not client.connect():
                client.close()
                raise RelayError("cannot connect")
            self._client = client
        return self._client


class ControlLine:
    """DTR or RTS of a serial port, which the kernel drops when the port is closed or this process dies.

    The kernel raises both for a moment when a port is opened: what hangs on them must not act within milliseconds.
    """

    def __init__(self, port: str, line: str) -> None:
        self._name, self._line = port, line
        self._port: Any = None

    def write(self, *, energised: bool) -> None:
        """See RelayOutput."""
        try:
            setattr(self._opened(), self._line, energised)
        except (OSError, ValueError, termios.error) as error:
            raise RelayError(str(error)) from error

    def close(self) -> None:
        """See RelayOutput."""
        port, self._port = self._port, None
        if port is not None:
            port.close()

    def _opened(self) -> Any:
        if self._port is None:
            port = serial.serial_for_url(self._name, do_not_open=True)
            port.dtr = port.rts = False
            port.open()
            self._port = port
        return self._port


def make_output(relay: Relay, timeout_s: float) -> RelayOutput:
    """The output that a site file describes, not yet connected."""
    if relay.output in {"dtr", "rts"}:
        return ControlLine(relay.port, relay.output)
    if relay.output == "modbus_tcp":
        host, _, port = relay.port.removeprefix("socket://").rpartition(":")
        return ModbusCoils(
            lambda: ModbusTcpClient(host, port=int(port), timeout=timeout_s, retries=0), relay.unit, relay.coils
        )
    return ModbusCoils(
        lambda: ModbusSerialClient(relay.port, baudrate=relay.baud, timeout=timeout_s, retries=0),
        relay.unit,
        relay.coils,
    )
