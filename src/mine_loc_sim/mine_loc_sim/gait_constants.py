"""Every free constant of the walkers, with its source.

"measured" = `bench/calibrate_gait.py` on the odd subjects (1, 3, … 13) of ipol_gait_lowerback, one value a subject;
the even subjects are kept for scoring. "cited" names its source. "assumed" has none.
"""

from dataclasses import dataclass

GRAVITY_M_S2 = 9.80665  # cited: standard gravity

# Population. Spreads are standard deviations between people.
HEIGHT_M, HEIGHT_SD_M = 1.72, 0.07  # assumed, adults
PREFERRED_SPEED_M_S, PREFERRED_SPEED_SD_M_S = 1.15, 0.21  # measured
ALPHA, BETA = 0.371, 0.227  # cited: paper B, its step length law's usual values
STRIDE_FACTOR, STRIDE_FACTOR_SD = 0.90, 0.052  # measured: K of the same law at the preferred speed's mean
STRIDE_FACTOR_PER_SPEED = 0.46  # measured, s/m: who walks faster takes longer steps
WAIST_SHARE_OF_HEIGHT = 0.58  # assumed: fifth lumbar vertebra
MAX_SPEED_M_S = 2.5  # assumed: people run above

# Steps.
MIN_STEP_FREQUENCY_HZ = 1.3  # assumed: slower walking has shorter steps, not slower ones
STEP_TIME_CV = 0.024  # measured 0.027, less the 0.010 s grid of its marks
STEP_LENGTH_CV = 0.03  # assumed: scatter about the law
STEP_TIME_ASYMMETRY_SD = 0.035  # measured: |left − right| / mean, median 0.03
TURN_FOOT_RADIUS_M = 0.35  # assumed: what a turn on the spot costs in steps
LEAST_STEP_M = 0.12  # assumed
LEAST_STEP_TURN_RAD = 0.26  # assumed

# Routes.
ROUTE_SPACING_S = 0.4  # assumed: rounds corners and starts over about a second
SPEED_CHANGE_M_S2 = 1.2  # assumed
U_TURN_S = 1.4  # measured: with the rounding above, median peak rate 3.5 rad/s, median length 1.6 s
TURN_BASE_SHARE = 0.4  # assumed: share of a U-turn's length that any turn takes

# The waist's motion: amplitudes at REFERENCE_SPEED_M_S and how they grow with speed.
REFERENCE_SPEED_M_S = 1.15  # measured: mean of the subjects
SPEED_EXPONENT = (1.8, 0.5, 2.0, 1.0, 2.1, 1.5)  # measured: of each channel's rms
GAIN_LOG_SD_COMMON, GAIN_LOG_SD_CHANNEL = 0.15, 0.26  # measured: 0.30 in all; its split is assumed
HARMONIC_LOG_SD = 0.6  # measured, about the channel's rms
STEP_GAIN_SD = (0.09, 0.13, 0.075, 0.075, 0.14, 0.13)  # measured: gain of a stride on the mean stride

# Motion that does not repeat, as deviation of acceleration [m/s²] (3) and angular rate [rad/s] (3).
WALK_IRREGULARITY = (0.45, 0.40, 0.53, 0.066, 0.14, 0.13)  # measured residual about the mean stride; 0.7 of it, assumed
WALK_IRREGULARITY_PEAK_HZ = 5.0  # assumed
STANDING_SWAY = (0.015, 0.015, 0.008, 0.006, 0.006, 0.008)  # assumed
STANDING_SWAY_PEAK_HZ = 0.5  # assumed

STRIDE_HARMONICS = 16


@dataclass(frozen=True, slots=True)
class Channel:
    """Harmonics of one channel against the phase of the stride, 0 at a left heel strike.

    A mirroring channel changes sign from a left to a right step, so its regular harmonics of the stride are 1, 3, …;
    the others' are 2, 4, …. What remains is left-right asymmetry, of any phase. Accelerations in m/s², rates of the angles in rad/s.
    """

    name: str
    mirrors: bool
    amplitude: tuple[float, ...]
    phase_rad: tuple[float, ...]
    phase_sd_rad: tuple[float, ...]
    asymmetric_amplitude: tuple[float, ...]


# measured: median amplitude, circular mean and spread of the phase over subjects.
CHANNELS = (
    Channel("forward", False, (1.344, 0.661, 0.582, 0.359, 0.210, 0.146, 0.129, 0.113),
            (1.28, 0.95, 0.40, -0.21, 0.35, -0.44, 2.31, 1.49),
            (0.12, 0.31, 0.34, 0.72, 0.92, 1.48, 1.19, 0.92),
            (0.072, 0.055, 0.082, 0.114, 0.073, 0.078, 0.053, 0.060)),
    Channel("left", True, (0.552, 0.274, 0.475, 0.552, 0.337, 0.360, 0.252, 0.144),
            (1.51, -2.61, 2.35, 0.93, 0.13, -0.29, -0.65, -1.10),
            (0.20, 1.38, 0.24, 0.89, 1.17, 0.76, 0.77, 1.07),
            (0.138, 0.064, 0.143, 0.169, 0.079, 0.050, 0.081, 0.058)),
    Channel("up", False, (2.109, 0.429, 0.766, 1.113, 0.623, 0.437, 0.296, 0.105),
            (-0.71, -0.27, -0.09, -1.43, -2.31, -2.61, -2.71, -2.78),
            (0.24, 0.96, 0.48, 0.63, 0.56, 1.14, 2.19, 1.15),
            (0.124, 0.133, 0.183, 0.155, 0.214, 0.226, 0.122, 0.084)),
    Channel("roll", True, (0.295, 0.316, 0.074, 0.061, 0.032, 0.055, 0.024, 0.016),
            (-0.26, -1.50, -2.27, -3.12, -2.93, 2.45, 2.03, 1.86),
            (0.57, 0.20, 0.51, 1.11, 0.89, 0.54, 0.93, 1.03),
            (0.052, 0.030, 0.024, 0.032, 0.025, 0.011, 0.007, 0.007)),
    Channel("pitch", False, (0.218, 0.076, 0.131, 0.058, 0.059, 0.027, 0.038, 0.027),
            (3.01, 2.92, -1.03, -0.78, -2.07, 3.12, -1.44, -1.78),
            (0.83, 1.25, 0.64, 2.05, 2.23, 1.39, 1.45, 1.60),
            (0.035, 0.022, 0.040, 0.020, 0.038, 0.024, 0.020, 0.025)),
    Channel("yaw", True, (0.189, 0.078, 0.084, 0.089, 0.106, 0.076, 0.047, 0.020),
            (-2.22, -1.97, -1.37, -2.76, 2.31, 1.50, 0.52, -0.06),
            (0.73, 1.42, 0.39, 0.81, 0.92, 0.88, 0.92, 1.62),
            (0.054, 0.014, 0.022, 0.032, 0.019, 0.018, 0.011, 0.013)),
)
