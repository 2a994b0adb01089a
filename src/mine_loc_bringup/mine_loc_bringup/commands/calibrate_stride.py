"""Find a person's step-length scale from walks of known length, and print the line for people.yaml.

Tape 20 m or more of straight level floor. Record each walk alone: stand for 3 s, walk to the end at the usual pace,
stand again, stop the recording:
  ros2 bag record /fitter/imu/data -o build/walk1
or, with the simulator, `mine-loc simulate --bag`. Two walks there and back are better than one; the standard error and
the spread over walks are printed. The scale holds for the model it was found with, and for the sensor at the waist.

Examples:
  mine-loc calibrate-stride --site config/my_mine --person fitter build/walk1=20
  mine-loc calibrate-stride --site config/my_mine --person fitter --model paper_b build/walk1=20 build/walk2=19.8
"""

import argparse
from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.table import Table

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.people import Person, load_people
from mine_loc_pdr.dead_reckoning import PedestrianDeadReckoning
from mine_loc_pdr.step_detector import NetworkStepDetector
from mine_loc_pdr.step_model_file import load_step_model, shipped_step_model
from mine_loc_pdr.stride import stride_model
from mine_loc_pdr.stride_calibration import StrideCalibration, calibrate_scale

_FEWEST_STEPS = 10
_SHORTEST_M, _LONGEST_M = 5.0, 2000.0
_ALLOWED_SCALE = (0.3, 3.0)  # people.schema.json


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("walks", nargs="+", metavar="BAG=METRES", help="folder of a bag, and the length of the walk in it")
    add("--site", type=Path, required=True, metavar="FOLDER", help="folder of people.yaml")
    add("--person", required=True, metavar="NAME", help="who walked, as people.yaml names them")
    add("--model", choices=("pendulum", "paper_b"), help="step-length model (default: as people.yaml says)")


def run(arguments: argparse.Namespace) -> int:
    """Exit status 0 when a scale was found."""
    person = _person(arguments.site, arguments.person, arguments.model)
    walks = [_walk(text) for text in arguments.walks]
    found: list[tuple[int, float]] = []
    with Console(stderr=True).status("reading walks"):
        for bag, _ in walks:
            found.append(_modelled(bag, person))
    walked_m = [metres for _, metres in walks]
    calibration = calibrate_scale(walked_m, [metres for _, metres in found])
    if not _ALLOWED_SCALE[0] <= calibration.scale <= _ALLOWED_SCALE[1]:
        raise ConfigurationError(f"k: {calibration.scale:.3f}; allowed: 0.3 to 3. Are the lengths of the walks right?")
    _print(walks, found, calibration, person)
    return 0


def _person(site: Path, name: str, model: str | None) -> Person:
    people = load_people(site)
    person = people.by_name(name)
    if person is None:
        raise ConfigurationError(f"--person: {name}; allowed: {', '.join(each.name for each in people)}")
    return replace(person, stride=replace(person.stride, k=1.0, model=model or person.stride.model))


def _walk(text: str) -> tuple[Path, float]:
    bag, _, metres = text.rpartition("=")
    try:
        length_m = float(metres)
    except ValueError:
        length_m = 0.0
    if not bag or not _SHORTEST_M <= length_m <= _LONGEST_M:
        raise ConfigurationError(f"BAG=METRES: {text}; allowed: a folder, =, {_SHORTEST_M:g} to {_LONGEST_M:g}")
    return Path(bag), length_m


def _modelled(bag: Path, person: Person) -> tuple[int, float]:
    """Steps in a bag and their length with k = 1."""
    from mine_loc_bringup.walk_bag import read_walk  # noqa: PLC0415 rosbags is slow to load

    model, _ = load_step_model(shipped_step_model())
    pdr = PedestrianDeadReckoning(stride_model(person), detector=NetworkStepDetector(model))
    lengths_m = [step.length_m for sample in read_walk(bag, person.name) for step in pdr.push(sample)]
    if len(lengths_m) < _FEWEST_STEPS:
        raise ConfigurationError(f"{bag}: {len(lengths_m)} steps found; allowed: a walk of {_FEWEST_STEPS} or more")
    return len(lengths_m), sum(lengths_m)


def _print(
    walks: list[tuple[Path, float]], found: list[tuple[int, float]], calibration: StrideCalibration, person: Person
) -> None:
    table = Table("walk", "steps", "length [m]", "with k = 1 [m]", "k")
    for (bag, true_m), (steps, modelled_m) in zip(walks, found, strict=True):
        table.add_row(str(bag), str(steps), f"{true_m:.2f}", f"{modelled_m:.2f}", f"{true_m / modelled_m:.3f}")
    Console().print(table)
    spread = "one walk only" if calibration.spread is None else f"spread over walks {calibration.spread:.3f}"
    print(f"k = {calibration.scale:.3f}, standard error {calibration.standard_error:.3f}; {spread}")
    stride = person.stride
    coefficients = f", alpha: {stride.alpha:g}, beta: {stride.beta:g}" if stride.model == "paper_b" else ""
    print(f"for {person.name} in people.yaml:")
    print(f"    stride: {{model: {stride.model}, k: {calibration.scale:.3f}{coefficients}}}")
