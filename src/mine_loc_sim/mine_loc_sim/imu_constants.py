"""Every free constant of the inertial unit and of the magnetic field it sits in, with its source.

"class" = figures of chips and modules of the N100's class (ICM-42688, ICM-20602, BMI055, BMI160, BMI270, Xsens MTi-1):
gyro 0.003–0.014 °/s/√Hz, accelerometer 75–160 µg/√Hz. "captured" = a frame of a real N100 in a public repository.
"assumed" has no source.
"""

import math
from dataclasses import dataclass

DEG = math.pi / 180
MG = 9.80665e-3  # thousandth of standard gravity, m/s²

RATE_HZ_RANGE = (50.0, 400.0)


@dataclass(frozen=True, slots=True)
class TriadSpec:
    """What devices of a class are drawn from: ranges are uniform, `_sd` are standard deviations; sensor's units."""

    noise_density: tuple[float, float]
    instability: tuple[float, float]
    turn_on_bias: tuple[float, float]
    scale_sd: float
    misalignment_sd_rad: float
    bias_per_kelvin_sd: float
    limit: float


GYRO = TriadSpec(
    noise_density=(0.007 * DEG, 0.014 * DEG),  # class
    instability=(5 * DEG / 3600, 10 * DEG / 3600),  # class: 5–10 °/h
    turn_on_bias=(0.1 * DEG, 0.5 * DEG),  # captured: 0.12–0.16 °/s at rest
    scale_sd=0.003,  # assumed
    misalignment_sd_rad=0.002,  # assumed
    bias_per_kelvin_sd=0.005 * DEG,  # assumed
    limit=2000 * DEG,  # assumed
)
ACCEL = TriadSpec(
    noise_density=(0.1 * MG, 0.2 * MG),  # class
    instability=(0.03 * MG, 0.06 * MG),  # class: MTi-1 0.03 mg
    turn_on_bias=(10 * MG, 40 * MG),  # class
    scale_sd=0.003,  # assumed
    misalignment_sd_rad=0.002,  # assumed
    bias_per_kelvin_sd=0.2 * MG,  # assumed
    limit=16_000 * MG,  # assumed
)
MAG = TriadSpec(  # milligauss
    noise_density=(0.3, 0.6),  # assumed
    instability=(0.5, 1.0),  # assumed
    turn_on_bias=(5.0, 60.0),  # assumed: hard iron of buckle and lamp battery
    scale_sd=0.03,  # assumed: soft iron
    misalignment_sd_rad=0.01,  # assumed
    bias_per_kelvin_sd=0.1,  # assumed
    limit=8000.0,  # assumed
)
INSTABILITY_S = 300.0  # assumed: correlation time of the slow bias
AMBIENT_C = 22.0  # assumed
SELF_HEATING_K, SELF_HEATING_S = 12.0, 400.0  # assumed
MOUNTING_SD_RAD = 5 * DEG  # assumed: how straight a belt is worn

EARTH_FIELD_T = (0.0, 30e-6, -40e-6)  # assumed ENU, mid-northern latitude: 50 µT, 53° down
STEEL_SD_SHARE = 0.6  # assumed: deviation of each component over Earth's field
STEEL_LENGTH_M = 2.0  # assumed: correlation length along a gallery
STEEL_WAVES = 24  # of the random field
FIELD_LIMIT_SHARE = 2.8  # captured: 1406 mG, 2.8 times Earth's field

# The device's own attitude filter, without magnetometer.
AHRS_TILT_SD_RAD, AHRS_TILT_S = 0.7 * DEG, 8.0  # assumed: class of low-cost filters while walking, correlation time
AHRS_DRIFT_SD_RAD_S = 20 * DEG / 3600  # assumed: bias left over by the filter
AHRS_HEADING_WALK = 0.012 * DEG  # class: gyro noise, rad/√s
