"""Real lower-back recordings beside simulated walks of the same protocol.

    python bench/sim_gait.py [--json FILE] [--calibration-half]

The even subjects of ipol_gait_lowerback are scored: no constant was fitted to them. `--calibration-half` compares with
the odd ones instead, on which the constants were measured (for development only). A figure is a subject's mean over
trials; real p10–p90 over subjects is the band, and the simulated median over people should lie in it: once for people
drawn from the population (of the recorded heights), once for people who also walk at the recorded speeds.
"""

import argparse
import json
import os
import sys
import time
from collections import defaultdict
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from gait_measures import measure
from gait_recordings import RATE_HZ, WALKED_M, Walk, level, steady_speed, walks

from mine_loc_sim.gait import Person, draw_person
from mine_loc_sim.imu_errors import FLU_TO_FRD, Imu, draw_device
from mine_loc_sim.magnetic_field import GalleryField
from mine_loc_sim.route import WayPoint, plan_route
from mine_loc_sim.walker import Walker

PEOPLE_A_HEIGHT = 8
TRIALS = 2
BLOCK = 4000  # samples
FIRST_SWING_S = 0.4  # a trial is marked from its first toe-off, which precedes the first heel strike by this


def simulate(person: Person, rng: np.random.Generator, subject: int, trial: int) -> Walk:
    """Stand, walk 10 m, turn, walk back, stop, as a device reports it and as the recordings are read."""
    there = (WALKED_M / 2, 0.0, 0.0)
    route = plan_route(
        [WayPoint((0.0, 0.0, 0.0), pause_s=5.0), WayPoint(there), WayPoint((0.0, 0.0, 0.0), pause_s=3.0)],
        person.preferred_speed_m_s,
    )
    walker = Walker(person, route, rng)
    imu = Imu(draw_device(rng), RATE_HZ, rng)
    motion = walker.motion(imu.stamps_ns(0, int(walker.duration_s * 1e9)))
    samples = imu.sample(motion, GalleryField(rng).at(motion.position_m))
    rate = samples.gyro_rad_s.astype(np.float64) * FLU_TO_FRD
    marks = {"left": [], "right": []}
    for step in walker.steps():
        marks[step.foot].append(round(step.stamp_ns * 1e-9 * RATE_HZ))
    (turn,) = walker.turns()
    strikes = sorted(marks["left"] + marks["right"])
    walk = Walk(
        subject,
        trial,
        person.height_m,
        samples.accel_m_s2.astype(np.float64) * FLU_TO_FRD,
        rate - rate[20 : int(4 * RATE_HZ)].mean(axis=0),
        np.array(marks["left"]),
        np.array(marks["right"]),
        strikes[0] - int(FIRST_SWING_S * RATE_HZ),
        round(turn.start_ns * 1e-9 * RATE_HZ),
        round(turn.stop_ns * 1e-9 * RATE_HZ),
        strikes[-1],
    )
    return level(walk)


def people_figures(source: list[Walk]) -> dict[str, np.ndarray]:
    """Each figure's mean over trials, one value a person."""
    trials = defaultdict(list)
    for walk in source:
        figures = measure(walk)
        if figures is not None:
            trials[walk.subject].append(figures)
    names = next(iter(trials.values()))[0]
    return {name: np.array([np.mean([t[name] for t in rows]) for rows in trials.values()]) for name in names}


def simulated(real: list[Walk], *, same_speed: bool) -> list[Walk]:
    """Simulated people of the recorded ones' heights; of their speeds too if `same_speed`, else as the population."""
    recorded = defaultdict(list)
    for walk in real:
        recorded[walk.subject].append(walk)
    result = []
    for subject, trials in recorded.items():
        speed = float(np.median([steady_speed(walk) for walk in trials])) if same_speed else None
        for i in range(PEOPLE_A_HEIGHT):
            rng = np.random.default_rng([subject, i])
            person = draw_person(rng, height_m=trials[0].height_m, preferred_speed_m_s=speed)
            result += [simulate(person, rng, subject * 100 + i, trial) for trial in range(TRIALS)]
    return result


def compare(real: np.ndarray, sim: np.ndarray, same_speed: np.ndarray) -> dict[str, float | bool]:
    """One figure's row: medians and 10–90 % over people."""
    values = {"sim": sim, "sim_same_speed": same_speed, "real": real}
    row = {name: float(np.median(v)) for name, v in values.items()}
    for name in ("sim", "real"):
        row[f"{name}_p10"], row[f"{name}_p90"] = map(float, np.percentile(values[name], [10, 90]))
    rounded: dict[str, float | bool] = {key: round(value, 5) for key, value in row.items()}
    rounded["in_band"] = row["real_p10"] <= row["sim"] <= row["real_p90"]
    rounded["in_band_same_speed"] = row["real_p10"] <= row["sim_same_speed"] <= row["real_p90"]
    return rounded


def print_table(result: dict[str, dict[str, float | bool]]) -> None:
    """The figures side by side; a star marks a simulated median outside the band of real people."""
    columns = ("sim", "sim_p10", "sim_p90", "sim_same_speed", "real", "real_p10", "real_p90")
    print(f"{'':32}" + "".join(f"{c.replace('sim_same_speed', 'same v'):>10}" for c in columns))
    for name, row in result.items():
        stars = {"sim": "in_band", "sim_same_speed": "in_band_same_speed"}
        cells = (f"{row[c]:9.3f}" + ("*" if c in stars and not row[stars[c]] else " ") for c in columns)
        print(f"{name:32}" + "".join(cells))
    for key in ("in_band", "in_band_same_speed"):
        print(f"{key}: {sum(bool(r[key]) for r in result.values())} of {len(result)} simulated medians")


def person_seconds_per_s() -> float:
    """Seconds of one person at 100 Hz, motion and IMU samples, generated in a second of one core's time."""
    rng = np.random.default_rng(0)
    person = draw_person(rng)
    begin = time.process_time()
    walker = Walker(person, plan_route([WayPoint((50.0 * (i % 2), 3.0 * i, 0.0)) for i in range(60)]), rng)
    imu, field = Imu(draw_device(rng), RATE_HZ, rng), GalleryField(rng)
    stamps = imu.stamps_ns(0, int(walker.duration_s * 1e9))
    for block in np.array_split(stamps, max(1, len(stamps) // BLOCK)):
        motion = walker.motion(block)
        imu.sample(motion, field.at(motion.position_m))
    return walker.duration_s / (time.process_time() - begin)


def run(*, calibration_half: bool = False) -> dict[str, dict[str, float | bool]]:
    """Compute and print every figure's row."""
    folder = Path(os.environ["MINE_LOC_DATA"]) / "ipol_gait_lowerback" / "GaitData"
    recorded = list(walks(folder, odd_subjects=calibration_half))
    real = people_figures(recorded)
    sim = people_figures(simulated(recorded, same_speed=False))
    same_speed = people_figures(simulated(recorded, same_speed=True))
    result = {name: compare(real[name], sim[name], same_speed[name]) for name in real}
    print(f"{len(real['steps'])} recorded people, {len(sim['steps'])} simulated")
    print_table(result)
    return result


def main() -> int:
    """Print the table and write it; exit status 0 whatever the figures say."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the figures here")
    parser.add_argument("--calibration-half", action="store_true", help="compare with the odd subjects")
    arguments = parser.parse_args()
    result = run(calibration_half=arguments.calibration_half)
    speed = person_seconds_per_s()
    print(f"{speed:.0f} person-seconds a second")
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(
            json.dumps({"gait": result, "person_seconds_per_s": {"walkers": round(speed)}}, indent=1) + "\n"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
