"""The magnetic field is trusted where it stays the same over a stretch of way, and refused by name where not."""

import math

import numpy as np
import pytest

from mine_loc_core.stamps import NS_PER_MS
from mine_loc_pdr.magnetic_field import STRETCH_M, FieldStretch, TrustedField

EARTH_T = (0.0, 30e-6, -40e-6)
PERIOD_NS = 100 * NS_PER_MS


def walked(field_of_way, speed_m_s=1.2, seconds=30.0, heading_rad=0.3):
    """What came of each stretch of a walk; `field_of_way` gives the field in odom at metres walked."""
    stretch, found = FieldStretch(), []
    for k in range(round(seconds * 10)):
        way_m = 0.12 * k * speed_m_s / 1.2
        verdict = stretch.push(k * PERIOD_NS, way_m, tuple(map(float, field_of_way(way_m))), heading_rad)
        if verdict is not None:
            found.append(verdict)
    return found


def test_an_even_field_is_trusted_with_its_strength_dip_and_azimuth():
    found = walked(lambda _: EARTH_T)
    assert len(found) == int(0.12 * 300 / (STRETCH_M + 0.12))
    assert all(isinstance(field, TrustedField) for field in found)
    assert found[0].strength_t == pytest.approx(50e-6)
    assert found[0].dip_rad == pytest.approx(math.atan2(40, 30))
    assert found[0].azimuth_rad == pytest.approx(math.pi / 2)
    assert found[0].heading_rad == pytest.approx(0.3)


def turned(angle_rad):
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return (-30e-6 * s, 30e-6 * c, -40e-6)


def tilted(angle_rad):
    return (0.0, 50e-6 * math.cos(angle_rad), -50e-6 * math.sin(angle_rad))


@pytest.mark.parametrize(
    ("check", "field_of_way"),
    [
        ("not_earths", lambda _: np.array(EARTH_T) * 2.0),
        ("not_earths", lambda _: np.array(EARTH_T) * 0.2),
        ("strength_varies", lambda way_m: np.array(EARTH_T) * (1.0 + 0.15 * math.sin(way_m))),
        ("dip_varies", lambda way_m: tilted(0.9 + 0.2 * math.sin(way_m))),
        ("against_gyro", lambda way_m: turned(0.3 * math.sin(way_m))),
        ("too_steep", lambda _: tilted(1.4)),
    ],
)
def test_a_field_that_is_not_the_same_or_not_earths_is_refused_by_name(check, field_of_way):
    found = walked(field_of_way)
    assert found
    assert set(found) == {check}


def test_who_does_not_get_on_measures_one_place_only():
    assert set(walked(lambda _: EARTH_T, speed_m_s=0.1, seconds=60.0)) == {"too_slow"}


def test_fields_resemble_each_other_by_strength_and_dip():
    field = TrustedField(50e-6, 0.9, 0.1, 0.0)
    assert field.resembles(TrustedField(51e-6, 0.95, 2.0, 1.0))
    assert not field.resembles(TrustedField(55e-6, 0.9, 0.1, 0.0))
    assert not field.resembles(TrustedField(50e-6, 1.1, 0.1, 0.0))
