"""A Modbus device of sixteen coils on this host, with its power switch, in a thread of its own."""

import asyncio
import contextlib
import socket
import threading
import time
from collections.abc import Iterator

from pymodbus.server import ModbusSerialServer, ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

UNIT = 7


class ModbusDevice:
    """TCP on a loopback port, or RTU on a serial port."""

    def __init__(self, serial_port: str | None = None) -> None:
        with socket.create_server(("127.0.0.1", 0)) as probe:
            self.port = probe.getsockname()[1]
        self._serial_port = serial_port
        self._writes: list[tuple[float, int, bool]] = []  # when (time.monotonic), coil, value
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        self._server: ModbusTcpServer | ModbusSerialServer | None = None

    def plug_in(self) -> None:
        asyncio.run_coroutine_threadsafe(self._serve(), self._loop).result(5.0)

    def unplug(self) -> None:
        if self._server is not None:
            asyncio.run_coroutine_threadsafe(self._server.shutdown(), self._loop).result(5.0)
            self._server = None

    def close(self) -> None:
        self.unplug()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(5.0)

    def coil(self, number: int = 0) -> bool:
        """What was last written."""
        return next((value for _, coil, value in reversed(self._writes) if coil == number), False)

    def written_since(self, instant_s: float) -> list[bool]:
        return [value for at_s, _, value in list(self._writes) if at_s > instant_s]

    async def _serve(self) -> None:
        coils = [SimData(0, count=1, values=0, datatype=DataType.REGISTERS)]
        device = SimDevice(UNIT, coils, use_bit_addressing=True, action=self._remember)
        if self._serial_port:
            self._server = ModbusSerialServer(device, port=self._serial_port, baudrate=9600)
        else:
            self._server = ModbusTcpServer(device, address=("127.0.0.1", self.port))
        await self._server.serve_forever(background=True)

    async def _remember(self, _code, _start, address, _count, _registers, values) -> None:
        if values is not None:
            self._writes.append((time.monotonic(), address, bool(values[0])))


@contextlib.contextmanager
def modbus_device(serial_port: str | None = None) -> Iterator[ModbusDevice]:
    """A device that is plugged in, and gone when the block ends."""
    device = ModbusDevice(serial_port)
    device.plug_in()
    try:
        yield device
    finally:
        device.close()
