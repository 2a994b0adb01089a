"""From the N100's axes and units to those of ROS: REP 103 (FLU body, ENU world, SI) and REP 145 (specific force).

The device speaks forward-right-down in the body and north-east-down in the world (docs/wire-formats.md).
"""

import math

from mine_loc_pdr.fdilink import ImuFrame, Quaternion, RawSensorsFrame, Vector3

TESLA_PER_MILLIGAUSS = 1e-7
ABSENT_BAROMETER_PA = 101325.0  # what the device reports when no barometer is fitted


def flu_from_frd(vector: Vector3) -> Vector3:
    """Forward-right-down to forward-left-up; its own inverse."""
    x, y, z = vector
    return x, -y, -z


def enu_flu_from_ned_frd(q: Quaternion) -> Quaternion:
    """Attitude w, x, y, z of FRD in NED to that of FLU in ENU; its own inverse."""
    w, x, y, z = q
    r = math.sqrt(0.5)
    return r * (w + z), r * (x + y), r * (x - y), r * (w - z)


def yaw_from_heading(heading_rad: float) -> float:
    """Heading from north clockwise to yaw from east counter-clockwise, in -π..π; its own inverse."""
    return math.remainder(math.pi / 2 - heading_rad, math.tau)


def field_tesla(magnetic_field_mg: Vector3) -> Vector3:
    """Magnetic field of the device (mG, FRD) to tesla in FLU."""
    x, y, z = flu_from_frd(magnetic_field_mg)
    return x * TESLA_PER_MILLIGAUSS, y * TESLA_PER_MILLIGAUSS, z * TESLA_PER_MILLIGAUSS


def pressure_pa(frame: ImuFrame | RawSensorsFrame) -> float | None:
    """Air pressure in Pa, or None where no barometer is fitted."""
    absent = frame.pressure_pa == ABSENT_BAROMETER_PA and frame.pressure_temperature_c == frame.temperature_c
    return None if absent else frame.pressure_pa
