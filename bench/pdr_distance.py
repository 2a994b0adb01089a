"""Walked distance: step-length models, each fitted to the other people only."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from gait_recordings import WALKED_M, Array
from pdr_recordings import Recording
from pdr_references import by_mean_stride
from pdr_tracks import HALT_S, SEARCH_S, UNKNOWN_HEIGHT_M, Track, inside, spread, track

from mine_loc_pdr.steps import StepDetector
from mine_loc_pdr.stride import PendulumStrideModel, StrideModel

Detectors = Callable[[Recording], StepDetector]
Columns = Mapping[str, Array]  # (walks, unknowns): lengths of walks that the fitted coefficients weight
SWING_EXPONENTS = np.arange(0.3, 0.51, 0.025)


def walked_m(recording: Recording, found: Track) -> float:
    """Sum of the step lengths within the trial, from toe-off to strike, or the bouts, from strike to strike."""
    if recording.turn is None:
        mask = inside(found.steps_s, [(begin + 2 * SEARCH_S, end) for begin, end, _ in recording.bouts], SEARCH_S)
    else:
        mask = inside(found.steps_s, recording.bouts, HALT_S)
    return float(sum(step.length_m for step, own in zip(found.steps, mask, strict=True) if own))


def lengths_m(recordings: Sequence[Recording], detector: Detectors, model: Callable[[float], Any]) -> Array:
    """Of each walk (walks,), by a model of a person of so many metres."""
    return np.array([walked_m(r, track(r, detector(r), model(r.height_m or UNKNOWN_HEIGHT_M))) for r in recordings])


def columns(recordings: Sequence[Recording], detector: Detectors) -> Columns:
    """One column a coefficient: paper B's K, (1, α, β) and the pendulum's factor."""
    lengths = partial(lengths_m, recordings, detector)
    base = lengths(lambda h: StrideModel(h, 0.0, 0.0))
    return {
        "paper_b_scale": lengths(StrideModel)[:, None],
        "paper_b_linear": np.stack(
            [
                base,
                lengths(lambda h: StrideModel(h, 1.0, 0.0)) - base,
                lengths(lambda h: StrideModel(h, 0.0, 1.0)) - base,
            ],
            axis=1,
        ),
        "pendulum": lengths(PendulumStrideModel)[:, None],
    }


def fit(table: Array) -> Array:
    """One coefficient of least mean error, so that one person beside the law bends it little; several of least squares,
    which serves them better.
    """
    if table.shape[1] > 1:
        return np.linalg.lstsq(table, np.full(len(table), WALKED_M), rcond=None)[0]
    ascending = table[np.argsort(-table[:, 0]), 0]  # of the factors that single walks ask for
    half = np.searchsorted(np.cumsum(ascending), 0.5 * ascending.sum())
    return np.array([WALKED_M / ascending[half]])


def held_out_errors_pct(table: Array, people: np.ndarray) -> Array:
    """Error of each walk with the coefficients of the other people."""
    errors = np.empty(len(table))
    for person in np.unique(people):
        own = people == person
        errors[own] = 100.0 * (table[own] @ fit(table[~own]) / WALKED_M - 1.0)
    return errors


def selected_errors_pct(tables: Columns, people: np.ndarray) -> Array:
    """For each person the model that does best on the others, each of these held out in turn."""
    errors = np.empty(len(people))
    for person in np.unique(people):
        own = people == person

        def loss(table: Array, own: np.ndarray = own) -> float:
            return float(np.abs(held_out_errors_pct(table[~own], people[~own])).mean())

        best = min(tables.values(), key=loss)
        errors[own] = 100.0 * (best[own] @ fit(best[~own]) / WALKED_M - 1.0)
    return errors


def stretches(recordings: Sequence[Recording], pendulum: Array) -> dict[str, float]:
    """For each person the pendulum's factor on the others of known height, over the shipped one."""
    people = np.array([r.person for r in recordings])
    known = np.array([r.height_m is not None for r in recordings])
    return {person: float(fit(pendulum[known & (people != person)])[0]) for person in np.unique(people)}


def ipol(recordings: Sequence[Recording], detector: Detectors) -> tuple[dict[str, Any], dict[str, float]]:
    """The figures of the people of known height; and what `stretches` says of all."""
    tables = columns(recordings, detector)
    known = np.array([r.height_m is not None for r in recordings])
    people = np.array([r.person for r in recordings])[known]
    cut = {name: table[known] for name, table in tables.items()}
    literature = 100.0 * (cut["paper_b_scale"][:, 0] / WALKED_M - 1.0)
    rows: dict[str, Any] = {name: _figures(held_out_errors_pct(table, people), people) for name, table in cut.items()}
    exponents = {
        f"{e:g}": lengths_m(recordings, detector, partial(PendulumStrideModel, swing_exponent=e))[known, None]
        for e in SWING_EXPONENTS
    }
    rows["pendulum_exponent_learnt_too"] = _figures(selected_errors_pct(exponents, people), people)
    rows["paper_b_literature"] = _figures(literature, people)
    rows["factor"] = round(float(fit(cut["pendulum"])[0]), 4)
    chosen = _figures(selected_errors_pct(cut, people), people)
    return chosen | {"models": rows}, stretches(recordings, tables["pendulum"])


def _figures(errors_pct: Array, people: np.ndarray) -> dict[str, Any]:
    own = [errors_pct[people == person] for person in np.unique(people)]
    return {
        "distance_error_pct": spread(np.abs(errors_pct)),
        "bias_pct": round(float(errors_pct.mean()), 2),
        "people_sd_pct": round(float(np.std([e.mean() for e in own])), 2),
        "walks_of_one_person_sd_pct": round(float(np.sqrt(np.mean([e.var() for e in own]))), 2),
    }


def mobgap(recordings: Sequence[Recording], tracks: Sequence[Track]) -> dict[str, Any]:
    """Walked metres of all bouts of a recording, the model as on ipol and the height taken for 1.70 m."""
    walked = [walked_m(recording, found) for recording, found in zip(recordings, tracks, strict=True)]
    true = [sum(metres for *_, metres in recording.bouts) for recording in recordings]
    errors = 100.0 * (np.array(walked) / true - 1.0)
    return {
        "distance_error_pct": spread(np.abs(errors)),
        "distance_per_recording_pct": {r.name: round(e, 1) for r, e in zip(recordings, errors.tolist(), strict=True)},
        "by_mean_stride": by_mean_stride(recordings, walked),
    }
