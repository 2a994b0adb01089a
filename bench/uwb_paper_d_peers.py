"""Public libraries on paper D's blinks: filterpy's KF and UKF, Stone Soup's EKF, all with `ekf`'s start, Q and R.

Their measurement is the vector of time differences to the first node heard and of levels, with full covariance.
"""

from collections.abc import Callable
from datetime import datetime, timedelta
from functools import partial
from time import perf_counter

import numpy as np
from filterpy.kalman import KalmanFilter, MerweScaledSigmaPoints, UnscentedKalmanFilter
from stonesoup.base import Property
from stonesoup.models.measurement.nonlinear import NonLinearGaussianMeasurement
from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantAcceleration
from stonesoup.predictor.kalman import ExtendedKalmanPredictor
from stonesoup.types.array import StateVector, StateVectors
from stonesoup.types.detection import Detection
from stonesoup.types.hypothesis import SingleHypothesis
from stonesoup.types.state import GaussianState
from stonesoup.updater.kalman import ExtendedKalmanUpdater
from uwb_paper_d_score import Reals
from uwb_paper_d_walks import RATE_HZ, Walk

from mine_loc_uwb.blink_likelihood import TdoaRssParameters
from mine_loc_uwb.constant_acceleration import noise_root, start_covariance, transition
from mine_loc_uwb.ekf import EkfParameters
from mine_loc_uwb.fix import Fix, FixStatus
from mine_loc_uwb.measurements import Measurements
from mine_loc_uwb.tdoa_rss import solve_blink

_STEP_S = 1.0 / RATE_HZ
_EPOCH = datetime(2000, 1, 1)  # noqa: DTZ001 Stone Soup wants a date, any
Update = Callable[[Measurements], Reals]


def run_peer(
    begin: Callable[[Fix, EkfParameters], Update], parameters: EkfParameters, walk: Walk
) -> tuple[Reals, Reals]:
    """Positions (n, 3), NaN before the first fix, and the time of each update [s]."""
    position_m, took_s = np.full((len(walk.blinks), 3), np.nan), []
    update: Update | None = None
    one_blink = TdoaRssParameters(parameters.path_loss, parameters.excess_sd_m)
    for number, blink in enumerate(walk.blinks):
        if update is None:
            fix, _ = solve_blink(blink, one_blink)
            if fix.status is FixStatus.OK:
                update, position_m[number] = begin(fix, parameters), fix.position_m
            continue
        began = perf_counter()
        position_m[number, :2] = update(blink)
        took_s.append(perf_counter() - began)
    return position_m, np.array(took_s)


def _expected(parameters: EkfParameters, blink: Measurements, place_m: Reals) -> Reals:
    """Time differences and levels (2n - 1,) at a place (2,)."""
    assert parameters.path_loss is not None
    assert blink.height_m is not None
    ranges_m = np.linalg.norm(np.append(place_m, blink.height_m) - blink.anchors_m, axis=1)
    return np.append(ranges_m[1:] - ranges_m[0], parameters.path_loss.level_dbm(ranges_m))


def _measured(parameters: EkfParameters, blink: Measurements) -> tuple[Reals, Reals]:
    """The same as measured, and covariance."""
    variance_m2 = blink.variance_m2 + parameters.excess_sd_m**2
    later = len(blink) - 1
    noise = np.diag(np.append(variance_m2[1:], np.full(len(blink), parameters.level_sd_db**2)))
    noise[:later, :later] += variance_m2[0]
    return np.append(blink.range_m[1:] - blink.range_m[0], blink.receive_power_dbm), noise


def filterpy_kf(fix: Fix, parameters: EkfParameters) -> Update:
    """Kalman filter on the fixes of `tdoa_rss`."""
    peer = KalmanFilter(dim_x=6, dim_z=2)
    peer.x, peer.P, peer.F, peer.Q = _start(fix, parameters)
    peer.H = np.eye(2, 6)
    one_blink = TdoaRssParameters(parameters.path_loss, parameters.excess_sd_m)

    def update(blink: Measurements) -> Reals:
        peer.predict()
        found, _ = solve_blink(blink, one_blink)
        if found.status is FixStatus.OK:
            peer.update(found.position_m[:2], R=found.covariance_m2[:2, :2])
        return np.asarray(peer.x[:2])

    return update


def filterpy_ukf(fix: Fix, parameters: EkfParameters) -> Update:
    """Unscented Kalman filter."""
    x, P, F, Q = _start(fix, parameters)
    points = MerweScaledSigmaPoints(6, alpha=0.5, beta=2.0, kappa=-3.0)
    peer = UnscentedKalmanFilter(6, 2, _STEP_S, hx=None, fx=lambda state, _: F @ state, points=points)
    peer.x, peer.P, peer.Q = x, P, Q

    def update(blink: Measurements) -> Reals:
        peer.predict()
        if len(blink):
            z, noise = _measured(parameters, blink)
            peer.update(z, R=noise, hx=lambda state: _expected(parameters, blink, state[:2]))
            peer.P = 0.5 * (peer.P + peer.P.T)
        return np.asarray(peer.x[:2])

    return update


class _Blinks(NonLinearGaussianMeasurement):  # type: ignore[misc]
    """Stone Soup's form of one blink; its state is (x, vx, ax, y, vy, ay)."""

    expected: Callable[[Reals], Reals] = Property(doc="Measurement expected at a place (2,)")

    @property
    def ndim_meas(self) -> int:
        return len(self.noise_covar)

    def function(self, state, noise=False, **_):  # type: ignore[no-untyped-def] # noqa: ANN001, ANN003, ANN202, ARG002, FBT002
        places = np.asarray(state.state_vector, float)[[0, 3]].reshape(2, -1)
        columns = np.array([self.expected(place) for place in places.T]).T
        return StateVector(columns) if columns.shape[1] == 1 else StateVectors(columns)

    def rvs(self, *_args, **_kwargs):  # type: ignore[no-untyped-def] # noqa: ANN002, ANN003, ANN202
        raise NotImplementedError


def stonesoup_ekf(fix: Fix, parameters: EkfParameters) -> Update:
    """Extended Kalman filter with numerical Jacobians."""
    x, P, _, _ = _start(fix, parameters)
    order = [0, 2, 4, 1, 3, 5]
    axis = ConstantAcceleration(parameters.jerk_density_m2_s5)
    predictor = ExtendedKalmanPredictor(CombinedLinearGaussianTransitionModel([axis, axis]))
    updater = ExtendedKalmanUpdater(measurement_model=None)
    state = GaussianState(x[order][:, None], P[np.ix_(order, order)], timestamp=_EPOCH)

    def update(blink: Measurements) -> Reals:
        nonlocal state
        now = state.timestamp + timedelta(seconds=_STEP_S)
        predicted = predictor.predict(state, timestamp=now)
        if len(blink):
            z, noise = _measured(parameters, blink)
            detection = Detection(
                z[:, None],
                timestamp=now,
                measurement_model=_Blinks(6, (0, 3), noise, expected=partial(_expected, parameters, blink)),
            )
            state = updater.update(SingleHypothesis(predicted, detection))
        else:
            state = GaussianState(predicted.state_vector, predicted.covar, timestamp=now)
        return np.asarray(state.state_vector, float)[[0, 3], 0]

    return update


def _start(fix: Fix, parameters: EkfParameters) -> tuple[Reals, Reals, Reals, Reals]:
    """State (p, v, a), covariance, transition and process noise as `ekf` has them, each in the order x y."""
    covariance = start_covariance(fix.covariance_m2[:2, :2], parameters.speed_sd_m_s, parameters.acceleration_sd_m_s2)
    root = noise_root(_STEP_S, parameters.jerk_density_m2_s5)
    across = np.eye(2)
    x = np.append(fix.position_m[:2], np.zeros(4))
    return x, covariance, np.kron(transition(_STEP_S), across), np.kron(root @ root.T, across)


PEERS: dict[str, Callable[[Fix, EkfParameters], Update]] = {
    "filterpy_kf": filterpy_kf,
    "filterpy_ukf": filterpy_ukf,
    "stonesoup_ekf": stonesoup_ekf,
}
