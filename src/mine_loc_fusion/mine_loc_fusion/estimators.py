"""The estimators by name, as the parameter `method` of the fusion node chooses them."""

from collections.abc import Callable, Mapping
from dataclasses import replace

from mine_loc_core.walkable_area import WalkableArea
from mine_loc_fusion.adaptive_ekf import AdaptiveEkf
from mine_loc_fusion.ekf import Ekf
from mine_loc_fusion.estimate import Estimator
from mine_loc_fusion.los_weighted import LosWeighted, LosWeightedSettings
from mine_loc_fusion.robust_kf import RobustKf
from mine_loc_fusion.tightly_coupled import TightlyCoupled
from mine_loc_fusion.tightly_coupled_settings import TightlyCoupledSettings

RIVALS: Mapping[str, Callable[[], Estimator]] = {
    "los_weighted": LosWeighted,
    "los_weighted_residual": lambda: LosWeighted(LosWeightedSettings(residual_gate=3.0)),
    "robust_kf": RobustKf,
    "ekf": Ekf,
    "adaptive_ekf": AdaptiveEkf,
}


def make_estimator(method: str, systematic_sd_m: float, height_m: float | None, area: WalkableArea | None) -> Estimator:
    """A new estimator of one person; `height_m` and `area` as in TightlyCoupled.

    `systematic_sd_m` is what stays of a link's error where radios are not calibrated, and is added to what is claimed.
    """
    if method != "mine_loc":
        return RIVALS[method]()
    given = TightlyCoupledSettings()
    stepping, carried, alone = (
        replace(each, systematic_sd_m=systematic_sd_m) for each in (given.stepping, given.carried, given.alone)
    )
    return TightlyCoupled(replace(given, stepping=stepping, carried=carried, alone=alone), height_m, area)
