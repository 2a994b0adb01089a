"""The coarse positioning and its rivals on the same reports: what each says is where."""

import time
from dataclasses import dataclass

import numpy as np
from coarse_scenes import Scene
from numpy.typing import NDArray
from sklearn.cluster import DBSCAN

from mine_loc_coarse.coarse_positioning import CoarsePositioning
from mine_loc_coarse.crossing import cross, pairs_within
from mine_loc_coarse.emissions import emissions
from mine_loc_coarse.open_reports import OpenReports
from mine_loc_coarse.region_radius import region_radius_m
from mine_loc_coarse.settings import CoarseSettings
from mine_loc_coarse.tracks import Status
from mine_loc_sim import bearing_constants as bc

Array = NDArray[np.float64]
SETTINGS = CoarseSettings()
WIDE_PROBABILITY = 0.999


@dataclass(frozen=True, slots=True)
class Answer:
    """What a method states: frequencies (k,), positions (k, 2), radii of 95 % and of 99.9 % (k,), seconds it took.

    `cpu_seconds` is that of the processor alone, `ambiguous` the number of regions that are flagged and state nothing,
    `neighbours` (k, k) who is near whom.
    """

    frequency_hz: Array
    position_m: Array
    radius_m: Array
    wide_m: Array
    seconds: float
    cpu_seconds: float
    ambiguous: int
    neighbours: NDArray[np.bool_]


def coarse(scene: Scene) -> Answer:
    """Ours, as it runs live: a situation each round, the last one scored.

    The time is that of a positioning which is given all the reports at once and forms the whole situation from them.
    """
    reports = [report for _, report in scene.sent]
    fresh = CoarsePositioning(scene.monitors, SETTINGS)
    began, cpu_began = time.perf_counter(), time.process_time()
    fresh.add(reports, scene.now_ns)
    fresh.situation(scene.now_ns)
    seconds, cpu_seconds = time.perf_counter() - began, time.process_time() - cpu_began
    live, taken = CoarsePositioning(scene.monitors, SETTINGS), 0
    for now_ns in range(bc.ROUND_NS, scene.now_ns + 1, bc.ROUND_NS):
        arrived = taken
        while arrived < len(scene.sent) and scene.sent[arrived][0] <= now_ns:
            arrived += 1
        live.add(reports[taken:arrived], now_ns)
        taken = arrived
        situation = live.situation(now_ns)
    stated = [region for region in situation.regions if region.status in {Status.NEW, Status.KEPT}]
    covariance = np.array([region.covariance_m2 for region in stated]).reshape(-1, 2, 2)
    ids = [region.id for region in stated]
    return Answer(
        np.array([region.frequency_hz for region in stated]),
        np.array([region.centre_m for region in stated]).reshape(-1, 2),
        np.array([region.radius_m for region in stated]),
        region_radius_m(covariance, WIDE_PROBABILITY),
        seconds,
        cpu_seconds,
        sum(region.status is Status.AMBIGUOUS for region in situation.regions),
        np.array([[other in region.neighbour_ids for other in ids] for region in stated], bool).reshape(len(ids), -1),
    )


@dataclass(frozen=True, slots=True)
class Initial:
    """All crossings of single reports, D_I of paper E: emission (c,), stamp (c,), position, covariance."""

    emission: NDArray[np.int64]
    stamp_ns: NDArray[np.int64]
    position_m: Array
    covariance_m2: Array
    emission_hz: Array


def initial_set(scene: Scene) -> Initial:
    """Cross every pair of reports of one scan and frequency (paper E, step 3)."""
    open_reports = OpenReports([monitor.id for monitor in scene.monitors], SETTINGS)
    open_reports.add([report for _, report in scene.sent], scene.now_ns)
    reports = open_reports.current(scene.now_ns)
    emission = emissions(reports, SETTINGS.frequency_accuracy_hz)
    order = np.lexsort((reports.monitor, reports.stamp_ns, emission))
    reports, emission = reports.taken(order), emission[order]
    changed = (np.diff(emission, prepend=-1) != 0) | (np.diff(reports.stamp_ns, prepend=-1) != 0)
    first, second = pairs_within(np.cumsum(changed))
    apart = reports.monitor[first] != reports.monitor[second]
    place_m = np.array([monitor.position_m[:2] for monitor in scene.monitors])[reports.monitor]
    variance = np.full(len(reports), SETTINGS.azimuth_sd_rad**2)
    found = cross(place_m, reports.azimuth_rad, variance, first[apart], second[apart], SETTINGS.detection_range_m)
    emission_hz = np.bincount(emission, reports.middle_hz) / np.bincount(emission)
    return Initial(
        emission[found.first], reports.stamp_ns[found.first], found.position_m, found.covariance_m2, emission_hz
    )


@dataclass(frozen=True, slots=True)
class DbscanTuning:
    """Neighbourhood [m], least points of a core, centre weighted by covariance or not, radius over scatter."""

    eps_m: float
    min_samples: int
    weighted: bool
    radius_scale: float


def dbscan(scene: Scene, tuning: DbscanTuning) -> Answer:
    """Pairwise crossing, then DBSCAN on each frequency; a cluster is a node."""
    began, cpu_began = time.perf_counter(), time.process_time()
    initial = initial_set(scene)
    hz, places, radii = [], [], []
    for emission in np.unique(initial.emission).tolist():
        own = initial.emission == emission
        points = initial.position_m[own]
        label = DBSCAN(eps=tuning.eps_m, min_samples=tuning.min_samples).fit_predict(points)
        weight = (
            1.0 / np.trace(initial.covariance_m2[own], axis1=1, axis2=2) if tuning.weighted else np.ones(len(points))
        )
        for number in range(int(label.max()) + 1):
            members = label == number
            centre = np.average(points[members], axis=0, weights=weight[members])
            scatter = np.sqrt(np.average(np.sum((points[members] - centre) ** 2, axis=1), weights=weight[members]))
            hz.append(initial.emission_hz[emission])
            places.append(centre)
            radii.append(tuning.radius_scale * max(scatter, 1.0))
    return _answer(hz, places, np.array(radii), time.perf_counter() - began, time.process_time() - cpu_began)


def crossing_alone(scene: Scene) -> Answer:
    """Every crossing of the last round is a node."""
    began, cpu_began = time.perf_counter(), time.process_time()
    initial = initial_set(scene)
    last = initial.stamp_ns >= scene.now_ns - bc.LONGEST_DELAY_NS - bc.ROUND_NS
    radius_m = region_radius_m(initial.covariance_m2[last], 0.95)
    hz = initial.emission_hz[initial.emission[last]]
    return _answer(
        hz.tolist(), [*initial.position_m[last]], radius_m, time.perf_counter() - began, time.process_time() - cpu_began
    )


def _answer(hz: list[float], places: list[Array], radius_m: Array, seconds: float, cpu_seconds: float) -> Answer:
    position_m = np.array(places).reshape(-1, 2)
    near = np.hypot(*(position_m[:, None] - position_m).transpose(2, 0, 1)) <= SETTINGS.communication_range_m
    np.fill_diagonal(near, val=False)
    # The circles of a two-dimensional Gaussian: 99.9 % is 3.72 σ, 95 % is 2.45 σ.
    return Answer(np.array(hz), position_m, radius_m, radius_m * (3.717 / 2.448), seconds, cpu_seconds, 0, near)
