"""FDILink, the wire format of the WHEELTEC N100 (FDISYSTEMS DETA10): frames to bytes and back.

A frame is `FC type length sn crc8(first four) crc16_high crc16_low payload FD`, with the payload little-endian and
CRC-16/XMODEM over the payload alone; a frame of length zero ends after its CRC-8. The format and its public sources
are described in docs/wire-formats.md. All values keep the device's units and axes: `mine_loc_pdr.n100_axes` converts.
"""

import binascii
import struct
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from mine_loc_core.framing import INCOMPLETE, Damaged, Found, FrameScanner, Incomplete

Vector3: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]

START, END = 0xFC, 0xFD
IMU, AHRS, RAW_SENSORS = 0x40, 0x41, 0x58
MAX_PAYLOAD = 247  # the vendor's SDK refuses 248 and more

_HEADER_SIZE = 5  # up to and including the CRC-8
_BODY = 7  # where the payload begins
_OVERHEAD = 8
_IMU = struct.Struct("<12fq")
_AHRS = struct.Struct("<10fq")
_RAW_SENSORS = struct.Struct("<12f")
IMU_ROW = np.dtype([("values", "<f4", 12), ("timestamp_us", "<i8")])
"""A payload of 0x40 as a row of an array: `values` in the order of ImuFrame's fields."""
AHRS_ROW = np.dtype([("values", "<f4", 10), ("timestamp_us", "<i8")])
"""A payload of 0x41 as a row of an array: `values` in the order of AhrsFrame's fields."""


@dataclass(frozen=True, slots=True)
class ImuFrame:
    """Message 0x40: calibrated sensors, body axes forward-right-down."""

    angular_velocity_rad_s: Vector3
    specific_force_m_s2: Vector3  # gravity included: z is about -9.81 at rest and level
    magnetic_field_mg: Vector3  # milligauss
    temperature_c: float
    pressure_pa: float
    pressure_temperature_c: float
    timestamp_us: int  # since power-up


@dataclass(frozen=True, slots=True)
class AhrsFrame:
    """Message 0x41: attitude of the forward-right-down body in north-east-down."""

    euler_rate_rad_s: Vector3  # roll, pitch, heading
    euler_rad: Vector3  # roll, pitch, heading from north clockwise, 0..2π
    orientation: Quaternion  # w, x, y, z; turns body vectors into north-east-down
    timestamp_us: int


@dataclass(frozen=True, slots=True)
class RawSensorsFrame:
    """Message 0x58: uncalibrated sensors; carries no time."""

    specific_force_m_s2: Vector3
    angular_velocity_rad_s: Vector3
    magnetic_field_mg: Vector3
    temperature_c: float
    pressure_pa: float
    pressure_temperature_c: float


Frame: TypeAlias = ImuFrame | AhrsFrame | RawSensorsFrame


def _crc8_table() -> bytes:
    """CRC-8/MAXIM-DOW, polynomial 0x31 reflected."""
    table = bytearray(range(256))
    for _ in range(8):
        table = bytearray((value >> 1) ^ (0x8C if value & 1 else 0) for value in table)
    return bytes(table)


_CRC8 = _crc8_table()


def crc8(data: bytes | bytearray) -> int:
    """CRC-8/MAXIM-DOW of `data`."""
    crc = 0
    for byte in data:
        crc = _CRC8[crc ^ byte]
    return crc


def crc16(data: bytes | bytearray) -> int:
    """CRC-16/XMODEM of `data`."""
    return binascii.crc_hqx(data, 0)


class FdilinkDecoder:
    """Bytes in any chunking to frames; never raises on hostile input.

    `losses` counts by kind: crc8, crc16, trailer, length (damage; a frame broken once may be found broken again on
    the rescan), skipped_bytes (all bytes between frames, idle FD bytes and text replies included), and lost_frames
    (gaps of the serial number, which all types share; it wraps at 256, so longer gaps count short).
    `skipped_types` counts good frames of a type, or of a length of a known type, that is not decoded here.
    """

    def __init__(self) -> None:
        self._scanner: FrameScanner[Frame] = FrameScanner(bytes([START]), self._parse)
        self.losses: Counter[str] = self._scanner.losses
        self.skipped_types: Counter[int] = Counter()
        self._serial: int | None = None

    def feed(self, data: bytes) -> list[Frame]:
        """Take the next bytes of the stream and return the frames they complete, in order."""
        return self._scanner.feed(data)

    def reset(self) -> None:
        """Forget a partial frame and the serial number, after the link was reopened."""
        self._scanner.reset()
        self._serial = None

    def _parse(self, buffer: bytearray, offset: int) -> Found[Frame] | Incomplete | Damaged:
        if len(buffer) - offset < _HEADER_SIZE:
            return INCOMPLETE
        if crc8(buffer[offset : offset + 4]) != buffer[offset + 4]:
            return Damaged("crc8")
        length = buffer[offset + 2]
        if length and (problem := _payload_problem(buffer, offset, length)):
            return problem
        self._count_lost(buffer[offset + 3])
        frame = self._content(buffer[offset + 1], length, buffer, offset + _BODY)
        return Found(frame, length + _OVERHEAD if length else _HEADER_SIZE)

    def _count_lost(self, serial: int) -> None:
        if self._serial is not None and (lost := (serial - self._serial - 1) % 256):
            self.losses["lost_frames"] += lost
        self._serial = serial

    def _content(self, kind: int, length: int, buffer: bytearray, body: int) -> Frame | None:
        """Dispatch on type and length together: firmware generations give one type several lengths."""
        if kind == IMU and length == _IMU.size:
            return _imu_frame(_IMU.unpack_from(buffer, body))
        if kind == AHRS and length == _AHRS.size:
            return _ahrs_frame(_AHRS.unpack_from(buffer, body))
        if kind == RAW_SENSORS and length == _RAW_SENSORS.size:
            v = _RAW_SENSORS.unpack_from(buffer, body)
            return RawSensorsFrame(v[0:3], v[3:6], v[6:9], v[9], v[10], v[11])
        self.skipped_types[kind] += 1
        return None


def imu_frames(payloads: bytes) -> Iterator[ImuFrame]:
    """Frames of payloads of 0x40 that follow one another without anything between."""
    return map(_imu_frame, _IMU.iter_unpack(payloads))


def ahrs_frames(payloads: bytes) -> Iterator[AhrsFrame]:
    """Frames of payloads of 0x41 that follow one another without anything between."""
    return map(_ahrs_frame, _AHRS.iter_unpack(payloads))


def _imu_frame(v: tuple[Any, ...]) -> ImuFrame:
    return ImuFrame(v[0:3], v[3:6], v[6:9], v[9], v[10], v[11], v[12])


def _ahrs_frame(v: tuple[Any, ...]) -> AhrsFrame:
    return AhrsFrame(v[0:3], v[3:6], v[6:10], v[10])


def _payload_problem(buffer: bytearray, offset: int, length: int) -> Incomplete | Damaged | None:
    if length > MAX_PAYLOAD:
        return Damaged("length")
    if len(buffer) - offset < length + _OVERHEAD:
        return INCOMPLETE
    body = offset + _BODY
    if buffer[body + length] != END:
        return Damaged("trailer")
    if crc16(buffer[body : body + length]) != buffer[offset + 5] << 8 | buffer[offset + 6]:
        return Damaged("crc16")
    return None


def encode(frame: Frame, serial: int) -> bytes:
    """The bytes of one frame with serial number `serial` (0..255).

    Raises ValueError for a value that the wire cannot carry.
    """
    kind, payload = _payload(frame)
    return encode_payload(kind, payload, serial)


def encode_payload(kind: int, payload: bytes, serial: int) -> bytes:
    """Wrap any payload, also of a type that is not decoded here.

    Raises ValueError for a type or serial beyond a byte, or a payload longer than MAX_PAYLOAD.
    """
    if len(payload) > MAX_PAYLOAD:
        raise ValueError(f"payload of {len(payload)} bytes; allowed: 0 to {MAX_PAYLOAD}")
    if not (0 <= kind <= 255 and 0 <= serial <= 255):
        raise ValueError(f"type {kind}, serial number {serial}; allowed: 0 to 255 each")
    header = bytes((START, kind, len(payload), serial))
    header += bytes((crc8(header),))
    if not payload:
        return header
    return header + crc16(payload).to_bytes(2, "big") + payload + bytes((END,))


def _payload(frame: Frame) -> tuple[int, bytes]:
    try:
        match frame:
            case ImuFrame(gyro, force, field, temperature, pressure, pressure_temperature, time):
                environment = (temperature, pressure, pressure_temperature)
                return IMU, _IMU.pack(*gyro, *force, *field, *environment, time)
            case AhrsFrame(rates, euler, orientation, time):
                return AHRS, _AHRS.pack(*rates, *euler, *orientation, time)
            case RawSensorsFrame(force, gyro, field, temperature, pressure, pressure_temperature):
                environment = (temperature, pressure, pressure_temperature)
                return RAW_SENSORS, _RAW_SENSORS.pack(*force, *gyro, *field, *environment)
    except (struct.error, OverflowError) as error:
        raise ValueError(f"{frame} does not fit the wire: {error}") from error
