"""sensor_msgs/Imu and sensor_msgs/MagneticField as serialised bytes: Imu written, of both read what is needed.

Building the Python message of a sample costs twice what dead reckoning does with it: a dozen objects, of which two
vectors and the stamp are wanted; and it was most of what a driver did. The bytes are CDR (OMG, "DDS Interoperability
Wire Protocol" 2.5, section 10.2): four bytes that name the encoding, then the fields in order, each aligned to its
size, counted from behind those four.
"""

import struct
from collections.abc import Sequence

from mine_loc_core.stamps import NS_PER_S
from mine_loc_pdr.attitude import Quaternion, Vector3
from mine_loc_pdr.dead_reckoning import FieldSample, ImuSample

_ENCODINGS = {b"\x00\x00": ">", b"\x00\x01": "<"}  # CDR, big and little endian
_BODY_AT = 4
_HEADER = {order: struct.Struct(order + "iII") for order in "<>"}  # s, ns, length of frame_id with its final zero
_VECTOR = {order: struct.Struct(order + "3d") for order in "<>"}
_IMU = struct.Struct("<37d")
"""Orientation x y z w, angular velocity and linear acceleration, each with its covariance behind it."""
_STAMP = struct.Struct("<iI")
_IDENTITY = 1.0, 0.0, 0.0, 0.0
_ABSENT: tuple[float, ...] = (-1.0, *8 * (0.0,))  # sensor_msgs/Imu: this quantity is not there
_RATE_AT = 8 * (4 + 9)  # behind the orientation and its covariance
_FORCE_AT = _RATE_AT + 8 * (3 + 9)


class ImuWriter:
    """Serialises the samples of one sensor; covariances are row-major 3×3, all zero = unknown (REP 145)."""

    def __init__(
        self, frame_id: str, orientation: Sequence[float], rate: Sequence[float], force: Sequence[float]
    ) -> None:
        name = frame_id.encode() + b"\0"
        self._doubles_at = _BODY_AT + -(-(12 + len(name)) // 8) * 8
        self._bytes = bytearray(self._doubles_at + _IMU.size)
        self._bytes[:_BODY_AT] = b"\x00\x01\x00\x00"
        _HEADER["<"].pack_into(self._bytes, _BODY_AT, 0, 0, len(name))
        self._bytes[_BODY_AT + 12 : _BODY_AT + 12 + len(name)] = name
        self._orientation, self._rate, self._force = tuple(orientation), tuple(rate), tuple(force)

    def write(self, stamp_ns: int, orientation: Quaternion | None, rate_rad_s: Vector3, force_m_s2: Vector3) -> bytes:
        """One sample; `orientation` is w x y z, None = not there."""
        w, x, y, z = orientation or _IDENTITY
        spread = _ABSENT if orientation is None else self._orientation
        _STAMP.pack_into(self._bytes, _BODY_AT, *divmod(stamp_ns, NS_PER_S))
        _IMU.pack_into(
            self._bytes, self._doubles_at, x, y, z, w, *spread, *rate_rad_s, *self._rate, *force_m_s2, *self._force
        )
        return bytes(self._bytes)


def imu_sample(message: bytes) -> ImuSample:
    """Stamp, angular velocity and linear acceleration of a sensor_msgs/Imu; raises ValueError if it is none."""
    stamp_ns, order, at = _header(message)
    return ImuSample(stamp_ns, _vector(message, order, at + _RATE_AT), _vector(message, order, at + _FORCE_AT))


def field_sample(message: bytes) -> FieldSample:
    """Stamp and magnetic field of a sensor_msgs/MagneticField; raises ValueError if it is none."""
    stamp_ns, order, at = _header(message)
    return FieldSample(stamp_ns, _vector(message, order, at))


def _header(message: bytes) -> tuple[int, str, int]:
    """Stamp, byte order, and where the doubles behind the std_msgs/Header begin."""
    order = _ENCODINGS.get(bytes(message[:2]))
    if order is None or len(message) < _BODY_AT + 12:
        raise ValueError(f"{len(message)} bytes beginning {bytes(message[:4]).hex()}: no message in plain CDR")
    seconds, nanoseconds, length = _HEADER[order].unpack_from(message, _BODY_AT)
    behind = -(-(12 + length) // 8) * 8
    return seconds * NS_PER_S + nanoseconds, order, _BODY_AT + behind


def _vector(message: bytes, order: str, at: int) -> Vector3:
    if at + 24 > len(message):
        raise ValueError(f"{len(message)} bytes: the message ends within its vectors")
    x, y, z = _VECTOR[order].unpack_from(message, at)
    return x, y, z
