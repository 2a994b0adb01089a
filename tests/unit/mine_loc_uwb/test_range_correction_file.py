from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mine_loc_core.errors import ConfigurationError
from mine_loc_uwb.power_bias import NO_POWER_BIAS, PowerBias, aps011
from mine_loc_uwb.range_calibration import Calibration, RangeError
from mine_loc_uwb.range_correction import RangeCorrection
from mine_loc_uwb.range_correction_file import load_range_correction, range_correction_text
from mine_loc_uwb.range_polynomial import RangePolynomial

GOOD = """\
schema: 1
date: 2026-03-01
stamp_latency_s: 0.17
antenna_delay: {offset_m: 0.24}
power_bias: {kind: table, receive_power_dbm: [-90, -80], bias_m: [0.04, -0.1]}
nlos_polynomial:
  link_classes: [1, 2]
  fitted_m: [4.0, 60]
  control_m: [3.5, 30.0, 58.0]
  residual_sd_m: 0.07
"""


def loaded(folder: Path, text: str) -> RangeCorrection:
    file = folder / "range_correction.yaml"
    file.write_text(text, "utf-8")
    return load_range_correction(file)


def test_a_file_says_what_it_says(tmp_path):
    assert loaded(tmp_path, GOOD) == RangeCorrection(
        0.24,
        PowerBias("table", (-90.0, -80.0), (0.04, -0.1)),
        RangePolynomial((3.5, 30.0, 58.0), (4.0, 60.0), 0.07),
        0.17,
    )


def test_stages_may_be_absent(tmp_path):
    text = "schema: 1\ndate: 2026-03-01\nantenna_delay: {offset_m: 0}\npower_bias: {kind: none}\n"
    assert loaded(tmp_path, text) == RangeCorrection()


@st.composite
def corrections(draw):
    def rising(low, high, least):
        values = np.cumsum([draw(st.floats(low, high)), *draw(st.lists(st.floats(0.01, 3.0), min_size=least))][:9])
        return tuple(values.tolist())

    levels = rising(-110.0, -90.0, 1)
    biases = tuple(draw(st.lists(st.floats(-1.0, 1.0), min_size=len(levels), max_size=len(levels))))
    law = draw(st.sampled_from([NO_POWER_BIAS, aps011(500, 16), aps011(900, 64), PowerBias("table", levels, biases)]))
    low_m = draw(st.floats(0.0, 50.0))
    nlos = RangePolynomial(rising(0.1, 9.0, 1), (low_m, low_m + draw(st.floats(0.1, 99.0))), draw(st.floats(0.0, 9.0)))
    offset_m, latency_s = draw(st.floats(-9.0, 9.0)), draw(st.floats(-0.5, 0.5))
    return RangeCorrection(offset_m, law, draw(st.sampled_from([None, nlos])), latency_s)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(corrections())
def test_what_is_written_is_read_back_to_the_last_digit(tmp_path, correction):
    errors = {"NLOS": RangeError(100, 1.37, 1.4, 1.9)}
    text = range_correction_text(Calibration(correction, errors, errors, {}), "2026-03-01")
    assert loaded(tmp_path, text) == correction


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("schema: 1", "schema: 2", ":1: schema: 2 is not allowed; allowed: 1"),
        ("2026-03-01", "1 March", ":2: date: '1 March' is not allowed"),
        ("0.17", ".nan", ":3: stamp_latency_s: nan is not allowed"),
        ("0.17", "170", ":3: stamp_latency_s: 170 is not allowed; allowed: a number -1 to 1"),
        ("offset_m: 0.24", "offset_mm: 240", "antenna_delay.offset_mm: no such key; use offset_m, in metres"),
        ("kind: table", "kind: aps", "power_bias.kind: 'aps' is not allowed; allowed: one of none, aps011, table"),
        ("kind: table", "kind: none", "power_bias.bias_m: [0.04, -0.1] does not go with kind none"),
        ("kind: table", "kind: aps011", "power_bias.prf_mhz: the key is missing"),
        ("[-90, -80]", "[-80, -90]", "power_bias.receive_power_dbm: [-80, -90] does not rise"),
        ("[0.04, -0.1]", "[0.04, -0.1, 0]", "power_bias.bias_m: 3 entries; allowed: 2"),
        ("[1, 2]", "[1, 2, 3]", "nlos_polynomial.link_classes: [1, 2, 3] is not allowed"),
        ("[4.0, 60]", "[60, 4.0]", "nlos_polynomial.fitted_m: [60, 4.0] holds nothing"),
        ("[4.0, 60]", "[4.0]", "nlos_polynomial.fitted_m: [4.0] has 1 entries"),
        ("[3.5, 30.0, 58.0]", "[3.5, 58.0, 30.0]", "nlos_polynomial.control_m: [3.5, 58.0, 30.0] does not rise"),
        ("[3.5, 30.0, 58.0]", "[-3.5, 30.0]", "nlos_polynomial.control_m[0]: -3.5 is not allowed"),
        ("residual_sd_m: 0.07", "residual_sd_m: wide", "nlos_polynomial.residual_sd_m: 'wide' is not allowed"),
        ("residual_sd_m: 0.07", "residual_sd: 0.07", "nlos_polynomial.residual_sd_m: the key is missing"),
    ],
)
def test_a_mistake_is_told_with_file_line_key_value_and_what_is_allowed(tmp_path, old, new, told):
    assert old in GOOD
    with pytest.raises(ConfigurationError) as refusal:
        loaded(tmp_path, GOOD.replace(old, new, 1))
    assert told in str(refusal.value)
    assert str(tmp_path / "range_correction.yaml") in str(refusal.value)


def test_a_file_that_is_not_there_is_told(tmp_path):
    with pytest.raises(ConfigurationError, match=r"nowhere\.yaml: cannot be read"):
        load_range_correction(tmp_path / "nowhere.yaml")
