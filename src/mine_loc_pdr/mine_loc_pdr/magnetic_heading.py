"""Heading held by the magnetic field where it can be trusted: later stretches against the first, the same way walked.

The azimuth of the first trusted stretch is the reference, whatever north is: dead reckoning needs no absolute heading,
only one that does not drift. The iron that a person carries turns with her and shifts the azimuth by a constant as long
as she walks the same way, so only stretches in about the direction of the reference are compared.
"""

import math
from collections import Counter

from mine_loc_pdr.drift import DriftModel
from mine_loc_pdr.magnetic_field import FieldStretch, TrustedField, Vector3

SAME_WAY_RAD = math.radians(45.0)
# Assumed: azimuth of a stretch, for what is left of the steel in an even field.
AZIMUTH_SD_RAD = math.radians(5.0)
# Assumed: iron on the person of 36 mG a horizontal axis, in a horizontal field of 300 mG. Between stretches walked at
# an angle Δ to each other it shifts the azimuth by 2 sin(Δ/2) times this.
WORN_IRON_SHARE = 0.12
GATE_SD = 3.0


class MagneticHeading:
    """Judges the field and says by how much the heading drifted. `verdicts` counts stretches by what came of them."""

    def __init__(self) -> None:
        self._stretch = FieldStretch()
        self._reference: TrustedField | None = None
        self._shift_rad = 0.0  # of the reference, learnt since
        self.verdicts: Counter[str] = Counter()

    def interrupted(self) -> None:
        """Something was missed: the stretch is not one."""
        self._stretch.reset()

    def push(self, stamp_ns: int, way_m: float, field_odom_t: Vector3, heading_rad: float) -> TrustedField | None:
        """Take a sample of the field in odom; the field of a stretch that can be trusted, when it ends."""
        found = self._stretch.push(stamp_ns, way_m, field_odom_t, heading_rad)
        if isinstance(found, str):
            self.verdicts[found] += 1
            return None
        return found

    def compare(self, found: TrustedField, drift: DriftModel) -> tuple[float, float] | None:
        """The corrections of heading (rad) and bias (rad/s) that a trusted field leads to, None if it leads to none.

        `drift`, which must be up to date, takes up what was learnt.
        """
        reference = self._reference
        if reference is None:
            self._reference = found
            drift.refer(AZIMUTH_SD_RAD**2)
            self.verdicts["reference"] += 1
            return None
        turned_rad = math.remainder(found.heading_rad - reference.heading_rad, math.tau)
        if not found.resembles(reference):
            self.verdicts["unlike_reference"] += 1
            return None
        if abs(turned_rad) > SAME_WAY_RAD:
            self.verdicts["another_way"] += 1
            return None
        off_rad = math.remainder(found.azimuth_rad - reference.azimuth_rad - self._shift_rad, math.tau)
        worn_sd_rad = 2.0 * WORN_IRON_SHARE * math.sin(0.5 * abs(turned_rad))
        corrections = drift.compare(off_rad, AZIMUTH_SD_RAD**2 + worn_sd_rad**2, GATE_SD)
        if corrections is None:
            self.verdicts["beyond_drift"] += 1
            return None
        self.verdicts["used"] += 1
        heading_rad, bias_rad_s, shift_rad = corrections
        self._shift_rad += shift_rad
        return heading_rad, bias_rad_s
