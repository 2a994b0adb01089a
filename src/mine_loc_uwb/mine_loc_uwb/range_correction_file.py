"""The file of a range correction: YAML, one version number, written by `mine-loc fit-ranges`, read by `uwb_solver`.

The published schema is `schema/range_correction.schema.json` of mine_loc_core.
"""

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import yaml

from mine_loc_core.yaml_schema import check_schema, read_schema
from mine_loc_core.yaml_source import KeyPath, YamlSource, load_yaml, refuse
from mine_loc_uwb.power_bias import NO_POWER_BIAS, PowerBias, aps011
from mine_loc_uwb.range_calibration import Calibration
from mine_loc_uwb.range_correction import RangeCorrection
from mine_loc_uwb.range_polynomial import RangePolynomial

_HEAD = "# Range correction, written by mine-loc fit-ranges; docs/range-correction.md explains every key.\n"
_KEYS_OF_KIND = {
    "none": (),
    "aps011": ("bandwidth_mhz", "prf_mhz"),
    "table": ("receive_power_dbm", "bias_m"),
}


def load_range_correction(file: Path) -> RangeCorrection:
    """Read and check a file; raises ConfigurationError with one line a mistake: file, line, key, value, allowed."""
    source = load_yaml(file)
    check_schema(source, read_schema("range_correction"))
    refuse(_contradictions(source))
    content = source.content
    nlos = _polynomial(content["nlos_polynomial"]) if "nlos_polynomial" in content else None
    return RangeCorrection(
        float(content["antenna_delay"]["offset_m"]),
        _power_bias(content["power_bias"]),
        nlos,
        float(content.get("stamp_latency_s", 0.0)),
    )


def range_correction_text(calibration: Calibration, date: str) -> str:
    """Text of the file of a calibration made on `date`, YYYY-MM-DD."""
    correction, law = calibration.correction, calibration.correction.power_bias
    content: dict[str, Any] = {
        "schema": 1,
        "date": date,
        "stamp_latency_s": correction.stamp_latency_s,
        "antenna_delay": {"offset_m": correction.antenna_offset_m},
        "power_bias": {"kind": law.kind},
    }
    if law.kind == "aps011":
        content["power_bias"] |= {"bandwidth_mhz": law.bandwidth_mhz, "prf_mhz": law.prf_mhz}
    if law.kind == "table":
        content["power_bias"] |= {"receive_power_dbm": list(law.level_dbm), "bias_m": list(law.bias_m)}
    if correction.nlos is not None:
        content["nlos_polynomial"] = {
            "link_classes": [1, 2],
            "fitted_m": list(correction.nlos.fitted_m),
            "control_m": list(correction.nlos.control_m),
            "residual_sd_m": correction.nlos.residual_sd_m,
        }
    told = {"before": calibration.before, "after": calibration.after, "held_out": calibration.held_out}
    content["statistics"] = {
        when: {label: asdict(error) for label, error in errors.items()} for when, errors in told.items()
    }
    return _HEAD + yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=120)


def _contradictions(source: YamlSource) -> Iterator[str]:
    """What the schema cannot see."""
    content = source.content
    law = content["power_bias"]
    for key in {*law, *_KEYS_OF_KIND[law["kind"]]} - {"kind"}:
        path: KeyPath = ("power_bias", key)
        if key not in law:
            yield source.problem(path, f"the key is missing; allowed: {key} with kind {law['kind']}")
        elif key not in _KEYS_OF_KIND[law["kind"]]:
            yield source.problem(path, f"{law[key]} does not go with kind {law['kind']}; allowed: no such key")
    power_dbm = law.get("receive_power_dbm", [])
    if any(after <= before for before, after in itertools.pairwise(power_dbm)):
        yield source.problem(("power_bias", "receive_power_dbm"), f"{power_dbm} does not rise; allowed: rising powers")
    if len(power_dbm) != len(law.get("bias_m", power_dbm)):
        text = f"{len(law['bias_m'])} entries; allowed: {len(power_dbm)}, as many as receive_power_dbm"
        yield source.problem(("power_bias", "bias_m"), text)
    yield from _polynomial_problems(source, content.get("nlos_polynomial"))


def _polynomial_problems(source: YamlSource, item: Mapping[str, Any] | None) -> Iterator[str]:
    if item is None:
        return
    low_m, high_m = item["fitted_m"]
    if low_m >= high_m:
        path: KeyPath = ("nlos_polynomial", "fitted_m")
        yield source.problem(path, f"[{low_m}, {high_m}] holds nothing; allowed: a shorter and a longer range")
    elif not _polynomial(item).rises():
        path = ("nlos_polynomial", "control_m")
        text = f"{item['control_m']} does not rise; allowed: true ranges above 0 that rise"
        yield source.problem(path, text)


def _polynomial(item: Mapping[str, Any]) -> RangePolynomial:
    low_m, high_m = item["fitted_m"]
    control_m = tuple(float(each) for each in item["control_m"])
    return RangePolynomial(control_m, (float(low_m), float(high_m)), float(item["residual_sd_m"]))


def _power_bias(item: Mapping[str, Any]) -> PowerBias:
    if item["kind"] == "aps011":
        return aps011(item["bandwidth_mhz"], item["prf_mhz"])
    if item["kind"] == "table":
        level_dbm, bias_m = (tuple(float(each) for each in item[key]) for key in ("receive_power_dbm", "bias_m"))
        return PowerBias("table", level_dbm, bias_m)
    return NO_POWER_BIAS
