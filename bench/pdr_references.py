"""What the two references of mobgap_lowerback are worth: insoles (INDIP) and motion capture, one against the other."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gait_recordings import Array
from pdr_recordings import Bout, Recording
from pdr_tracks import TOLERANCE_S, Track, f1, false_steps, inside, lags, offset_s, spread

BORDER_S = 0.05  # contacts on the border of a bout belong to it


def references(recordings: Sequence[Recording], tracks: Sequence[Track]) -> dict[str, Any]:
    """F1 where both saw walking, of each pair of the references and ours; each one's false steps by the other;
    what marks and lengths leave out.
    """
    insoles = [contacts_s(r.references["INDIP"]) for r in recordings]
    optical = [contacts_s(r.references["Stereophoto"]) for r in recordings]
    found = [t.steps_s for t in tracks]

    def common(times: Sequence[Array]) -> list[Array]:
        return [
            t[np.all([inside(t, spans(own), BORDER_S) for own in r.references.values()], axis=0)]
            for t, r in zip(times, recordings, strict=True)
        ]

    def agreement(one: Sequence[Array], other: Sequence[Array]) -> float:
        one, other = common(one), common(other)
        late = offset_s(one, other)
        hits = sum(len(lags(a - late, b, TOLERANCE_S)) for a, b in zip(one, other, strict=True))
        return round(f1(hits, sum(map(len, one)), sum(map(len, other))), 4)

    bouts = [bout for r in recordings for bout in r.references["INDIP"]]
    feet = [np.atleast_1d(bout["InitialContact_LeftRight"]) for bout in bouts]
    strides_m = np.concatenate([np.atleast_1d(bout["Stride_Length"]).astype(float) for bout in bouts])
    return {
        "f1_optical_by_insoles": agreement(optical, insoles),
        "f1_ours_by_insoles": agreement(found, insoles),
        "f1_ours_by_optical": agreement(found, optical),
        "false_steps_per_min_optical_by_insoles": _false_per_min(recordings, optical, "INDIP"),
        "false_steps_per_min_insoles_by_optical": _false_per_min(recordings, insoles, "Stereophoto"),
        "insoles": {
            "contacts": sum(map(len, feet)),
            "without_instant": sum(int(np.isnan(_all_contacts_s(bout)).sum()) for bout in bouts),
            "same_foot_twice": sum(int(np.sum(foot[1:] == foot[:-1])) for foot in feet),
            "strides": len(strides_m),
            "strides_without_length": int(np.isnan(strides_m).sum()),
        },
    }


def by_mean_stride(recordings: Sequence[Recording], walked_m: Sequence[float]) -> dict[str, Any]:
    """Error of the walked metres where every step of the reference counts half its bout's mean stride.

    The reference's own length of a bout leaves out the strides that it could not measure.
    """
    errors = {}
    for recording, own_m in zip(recordings, walked_m, strict=True):
        bouts = recording.references["INDIP"] or recording.references["Stereophoto"]
        true_m = sum(0.5 * float(b["AverageStrideLength"]) * (len(_all_contacts_s(b)) - 1) for b in bouts)
        errors[recording.name] = 100.0 * (own_m / true_m - 1.0)
    return {
        "distance_error_pct": spread(np.abs(list(errors.values()))),
        "per_recording_pct": {name: round(error, 1) for name, error in errors.items()},
    }


def contacts_s(bouts: Sequence[Bout]) -> Array:
    """Instants of all bouts, sorted, without those that have none."""
    instants = np.sort(np.concatenate([np.empty(0), *map(_all_contacts_s, bouts)]))
    return instants[np.isfinite(instants)]


def spans(bouts: Sequence[Bout]) -> list[tuple[float, float]]:
    """Begin and end of each."""
    return [(float(bout["Start"]), float(bout["End"])) for bout in bouts]


def _all_contacts_s(bout: Bout) -> Array:
    return np.atleast_1d(bout["InitialContact_Event"]).astype(float)


def _false_per_min(recordings: Sequence[Recording], times_s: Sequence[Array], reference: str) -> float:
    """Of the contacts, by the bouts of the reference."""
    found = [false_steps(r, own, spans(r.references[reference])) for r, own in zip(recordings, times_s, strict=True)]
    false, rest_s = map(sum, zip(*found, strict=True))
    return round(60.0 * false / rest_s, 2)
