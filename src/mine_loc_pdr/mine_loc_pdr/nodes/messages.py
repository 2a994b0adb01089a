"""Measurements of an N100 to sensor_msgs (REP 145)."""

from dataclasses import dataclass

from sensor_msgs.msg import Imu, MagneticField
from std_msgs.msg import Header

from mine_loc_core.nodes.conversions import to_time
from mine_loc_pdr.n100_stream import ImuMeasurement
from mine_loc_pdr.parameters import N100DriverParameters

_ABSENT = [-1.0] + 8 * [0.0]  # sensor_msgs/Imu: this quantity is not there


@dataclass(frozen=True, slots=True)
class Covariances:
    """Row-major 3×3 each; all zero where the deviation is unknown (REP 145)."""

    force: list[float]
    rate: list[float]
    orientation: list[float]
    field: list[float]

    @staticmethod
    def of(p: N100DriverParameters) -> "Covariances":
        """Those of the stated standard deviations."""
        return Covariances(
            _isotropic(p.linear_acceleration_stddev),
            _isotropic(p.angular_velocity_stddev),
            _isotropic(p.orientation_stddev),
            _isotropic(p.magnetic_field_stddev),
        )


def imu_frame(person: str) -> str:
    """The frame of what `person` wears."""
    return f"{person}/imu_link"


def to_header(measurement: ImuMeasurement, person: str) -> Header:
    """Stamp and frame of a measurement of what `person` wears."""
    return Header(stamp=to_time(measurement.stamp_ns), frame_id=imu_frame(person))


def to_imu(measurement: ImuMeasurement, header: Header, covariances: Covariances) -> Imu:
    """Rates, specific force and, where the device knew it then, orientation."""
    imu = Imu(header=header)
    imu.angular_velocity.x, imu.angular_velocity.y, imu.angular_velocity.z = measurement.rate_rad_s
    imu.linear_acceleration.x, imu.linear_acceleration.y, imu.linear_acceleration.z = measurement.force_m_s2
    imu.angular_velocity_covariance = covariances.rate
    imu.linear_acceleration_covariance = covariances.force
    if measurement.orientation is None:
        imu.orientation_covariance = _ABSENT
    else:
        q = imu.orientation
        q.w, q.x, q.y, q.z = measurement.orientation
        imu.orientation_covariance = covariances.orientation
    return imu


def to_magnetic_field(measurement: ImuMeasurement, header: Header, covariances: Covariances) -> MagneticField:
    """Field in tesla."""
    mag = MagneticField(header=header, magnetic_field_covariance=covariances.field)
    mag.magnetic_field.x, mag.magnetic_field.y, mag.magnetic_field.z = measurement.field_t
    return mag


def _isotropic(stddev: float) -> list[float]:
    variance = stddev * stddev
    return [variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance]
