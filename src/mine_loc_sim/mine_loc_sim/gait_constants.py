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
# assumed: slower walking has shorter steps, not slower ones; mobgap_lowerback's people make 1.2–1.6 Hz at 0.25–0.5 m/s
MIN_STEP_FREQUENCY_HZ = 1.3
STEP_TIME_CV = 0.024  # measured 0.027, less the 0.010 s grid of its marks
STEP_LENGTH_CV = 0.03  # assumed: scatter about the law
STEP_TIME_ASYMMETRY_SD = 0.035  # measured: |left − right| / mean, median 0.03
TURN_FOOT_RADIUS_M = 0.35  # assumed: what a turn on the spot costs in steps
LEAST_STEP_M = 0.06  # assumed
LEAST_STEP_TURN_RAD = 0.26  # assumed

# Routes.
ROUTE_SPACING_S = 0.4  # assumed: rounds corners and starts over about a second
SPEED_CHANGE_M_S2 = 1.2  # assumed
U_TURN_S = 1.35  # measured: with the rounding above, between the measured median peak rate and length
TURN_BASE_SHARE = 0.4  # assumed: share of a U-turn's length that any turn takes

# The waist's motion: amplitudes at REFERENCE_SPEED_M_S and how they grow with speed.
REFERENCE_SPEED_M_S = 1.15  # measured: mean of the subjects
SPEED_EXPONENT = (1.5, 0.3, 1.9, 0.35, 2.0, 1.3)  # measured: of each channel's rms
FULL_GAIT_SPEED_SHARE = 0.4  # assumed: slower than this share of the reference speed, gait fades into standing
GAIN_LOG_SD = (0.29, 0.14, 0.11, 0.16, 0.45, 0.39)  # measured: of each channel's rms about that
ASYMMETRIC_LOG_SD = 0.5  # measured: of a harmonic about its channel's rms, median
STEP_GAIN_SD = (0.084, 0.112, 0.073, 0.068, 0.116, 0.115)  # measured: gain of a stride on the mean stride

# Motion that does not repeat, as deviation of acceleration [m/s²] (3) and angular rate [rad/s] (3).
# measured: 0.9 of the rms of strides about the mean stride; the rest is their timing and gain, assumed
WALK_IRREGULARITY = (0.50, 0.47, 0.56, 0.08, 0.165, 0.13)
IRREGULARITY_PEAK_HZ = 7.0  # measured: median frequency of that, of the accelerations
WALK_WANDER = (0.09, 0.05, 0.02, 0.010, 0.019, 0.032)  # measured: scatter of strides' means; up assumed
STANDING_SWAY = (0.015, 0.015, 0.008, 0.006, 0.006, 0.008)  # assumed
WANDER_PEAK_HZ = 0.5  # assumed: strides' means alternate, so about every second stride; sway likewise

STRIDE_HARMONICS = 16


@dataclass(frozen=True, slots=True)
class Channel:
    """Harmonics of one channel against the phase of the stride, 0 at a left heel strike.

    A mirroring channel changes sign from a left to a right step, so its regular harmonics of the stride are 1, 3, …;
    the others' are 2, 4, …. What remains is left-right asymmetry, of any phase. Accelerations in
    m/s², rates of the angles in rad/s.
    """

    name: str
    mirrors: bool
    amplitude: tuple[float, ...]
    amplitude_log_sd: tuple[float, ...]
    phase_rad: tuple[float, ...]
    phase_sd_rad: tuple[float, ...]
    asymmetric_amplitude: tuple[float, ...]


# measured, over subjects: median amplitude, log deviation about the channel's rms, circular mean and spread of phase.
CHANNELS = (
    Channel(
        "forward",
        mirrors=False,
        amplitude=(1.524, 0.666, 0.726, 0.376, 0.198, 0.213, 0.172, 0.108),
        amplitude_log_sd=(0.15, 0.41, 0.29, 0.58, 1.08, 0.70, 0.63, 0.42),
        phase_rad=(1.24, 0.90, 0.40, -0.28, 0.32, -0.73, 2.20, 1.45),
        phase_sd_rad=(0.15, 0.35, 0.37, 0.74, 0.76, 1.62, 0.93, 0.84),
        asymmetric_amplitude=(0.093, 0.087, 0.088, 0.118, 0.070, 0.086, 0.063, 0.059),
    ),
    Channel(
        "left",
        mirrors=True,
        amplitude=(0.595, 0.281, 0.580, 0.629, 0.478, 0.382, 0.263, 0.145),
        amplitude_log_sd=(0.32, 0.49, 0.26, 0.25, 0.32, 0.42, 0.52, 0.50),
        phase_rad=(1.47, -2.53, 2.33, 0.77, -0.03, -0.46, -0.77, -1.30),
        phase_sd_rad=(0.22, 1.37, 0.28, 0.88, 1.22, 0.90, 0.84, 1.17),
        asymmetric_amplitude=(0.138, 0.075, 0.142, 0.134, 0.091, 0.072, 0.087, 0.064),
    ),
    Channel(
        "up",
        mirrors=False,
        amplitude=(2.138, 0.391, 0.695, 1.010, 0.590, 0.355, 0.249, 0.128),
        amplitude_log_sd=(0.08, 0.38, 0.31, 0.32, 0.20, 0.32, 0.53, 0.69),
        phase_rad=(-0.74, -0.37, -0.11, -1.47, -2.41, -2.73, 2.99, -2.88),
        phase_sd_rad=(0.25, 1.04, 0.49, 0.63, 0.64, 1.24, 1.86, 1.19),
        asymmetric_amplitude=(0.113, 0.151, 0.186, 0.155, 0.256, 0.203, 0.136, 0.116),
    ),
    Channel(
        "roll",
        mirrors=True,
        amplitude=(0.291, 0.362, 0.122, 0.065, 0.032, 0.057, 0.032, 0.019),
        amplitude_log_sd=(0.18, 0.11, 0.45, 0.67, 0.57, 0.41, 0.47, 0.89),
        phase_rad=(-0.30, -1.58, -2.41, 3.12, -3.08, 2.40, 1.92, 1.69),
        phase_sd_rad=(0.60, 0.25, 0.51, 1.08, 0.92, 0.60, 1.12, 1.31),
        asymmetric_amplitude=(0.052, 0.034, 0.022, 0.034, 0.026, 0.014, 0.007, 0.007),
    ),
    Channel(
        "pitch",
        mirrors=False,
        amplitude=(0.203, 0.092, 0.113, 0.055, 0.056, 0.043, 0.035, 0.027),
        amplitude_log_sd=(0.57, 0.90, 0.44, 1.15, 0.78, 0.73, 1.08, 0.65),
        phase_rad=(2.98, 2.81, -1.12, -1.83, 0.81, 2.00, -0.74, -1.51),
        phase_sd_rad=(0.88, 1.33, 0.61, 1.93, 2.07, 2.69, 1.03, 0.86),
        asymmetric_amplitude=(0.032, 0.019, 0.036, 0.027, 0.038, 0.030, 0.016, 0.025),
    ),
    Channel(
        "yaw",
        mirrors=True,
        amplitude=(0.232, 0.102, 0.090, 0.110, 0.103, 0.084, 0.046, 0.025),
        amplitude_log_sd=(0.24, 0.94, 0.52, 0.53, 0.47, 0.55, 0.47, 0.86),
        phase_rad=(-2.29, -1.97, -1.41, -2.88, 2.20, 1.42, 0.55, -0.69),
        phase_sd_rad=(0.70, 1.58, 0.56, 0.89, 0.92, 1.10, 0.96, 2.05),
        asymmetric_amplitude=(0.050, 0.026, 0.023, 0.034, 0.019, 0.023, 0.014, 0.012),
    ),
)
