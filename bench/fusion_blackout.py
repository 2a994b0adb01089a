"""A minute without any range, then ranges again: how far steps go astray, and how soon the place is right again.

    python bench/fusion_blackout.py

Recaptured: from when on the error stays below half a metre for two seconds, since the first round after the blackout. A
wrong capture: ten seconds after it the error is still above a metre.
"""

import json
from dataclasses import fields, replace
from typing import Any

import numpy as np
from fusion_paper_a import begun
from fusion_runs import run_estimator
from fusion_walks import Walk, make_walk, scene, seeds
from uwb_tracks import Array, spread

from mine_loc_core.stamps import NS_PER_S, to_ns
from mine_loc_fusion.tightly_coupled import TightlyCoupled

_CAPTURED_M, _HELD_NS = 0.5, 2 * NS_PER_S
_WRONG_M, _WRONG_AFTER_S = 1.0, 10.0


def blacked_out(walk: Walk, from_s: float, to_s: float) -> tuple[Walk, int]:
    """The walk without the rounds between, and the number of the first round after them."""
    start_ns = walk.rounds[0].stamp_ns
    silent = [from_s <= (each.stamp_ns - start_ns) / NS_PER_S < to_s for each in walk.rounds]
    rounds = [each for each, gone in zip(walk.rounds, silent, strict=True) if not gone]
    kept = replace(walk, rounds=rounds, truth_m=walk.truth_m[~np.array(silent)])
    back_ns = start_ns + to_ns(to_s)
    return kept, next(n for n, each in enumerate(rounds) if each.stamp_ns >= back_ns)


def recapture_s(stamps_ns: Array, error_m: Array) -> float:
    """Time from the first stamp until the error stays small; inf = never."""
    for stamp_ns in stamps_ns:
        window = (stamps_ns >= stamp_ns) & (stamps_ns < stamp_ns + _HELD_NS)
        if (error_m[window] < _CAPTURED_M).all():
            return float((stamp_ns - stamps_ns[0]) / NS_PER_S)
    return float("inf")


def run() -> dict[str, Any]:
    """The figures over all seeds."""
    of = scene("blackout")
    astray, recaptured, wrong = [], [], 0
    for seed in seeds(of, "seeds"):
        walk, back = blacked_out(make_walk(of, seed), *of["blackout_s"])
        found = run_estimator(lambda w: begun(TightlyCoupled(), w), walk)
        error_m = np.linalg.norm(found.position_m - walk.truth_m, axis=1)
        stamps_ns = np.array([each.stamp_ns for each in walk.rounds])
        astray.append(_before(walk, back))
        recaptured.append(recapture_s(stamps_ns[back:], error_m[back:]))
        later = int(np.searchsorted(stamps_ns, stamps_ns[back] + to_ns(_WRONG_AFTER_S)))
        wrong += bool(error_m[min(later, len(error_m) - 1)] > _WRONG_M)
    return {
        "end_error_m": spread(astray),
        "recapture_s_mean": float(np.mean(recaptured)),
        "recapture_s_sd": float(np.std(recaptured, ddof=1)),
        "recapture_s_max": float(np.max(recaptured)),
        "wrong_captures": wrong,
        "runs": len(astray),
    }


def _before(walk: Walk, back: int) -> float:
    """Error at the end of the blackout: where the first round after it holds nothing."""
    first = walk.rounds[back]
    arrays = {
        f.name: getattr(first, f.name)[:0] for f in fields(first) if isinstance(getattr(first, f.name), np.ndarray)
    }
    deaf = replace(walk, rounds=[*walk.rounds[:back], replace(first, **arrays)], truth_m=walk.truth_m[: back + 1])
    found = run_estimator(lambda w: begun(TightlyCoupled(), w), deaf)
    return float(np.linalg.norm(found.position_m[-1] - deaf.truth_m[-1]))


if __name__ == "__main__":
    print(json.dumps(run(), indent=2))
