"""What a person does, window by window: standing, walking straight, turning (paper B, section 3.2.2)."""

import math
from dataclasses import dataclass
from enum import IntEnum

from mine_loc_core.stamps import to_s
from mine_loc_pdr.activity_features import FEATURES, log_vertical_sd
from mine_loc_pdr.activity_svm import Svm
from mine_loc_pdr.activity_window import WINDOW_NS, ActivityWindow, WindowStream
from mine_loc_pdr.attitude import Vector3


class ActivityKind(IntEnum):
    """As in mine_loc_interfaces/Activity; UNKNOWN is a window whose truth is not known."""

    UNKNOWN = 0
    STANDING = 1
    STRAIGHT = 2
    TURNING = 3


@dataclass(frozen=True, slots=True)
class Activity:
    """Of the `window_s` that end at `stamp_ns`; turn_rad is the change of heading, counter-clockwise positive."""

    stamp_ns: int
    kind: ActivityKind
    probability: float
    turn_rad: float
    window_s: float = to_s(WINDOW_NS)


@dataclass(frozen=True, slots=True)
class Logistic:
    """Probability 1 / (1 + exp(−(slope · value + intercept)))."""

    slope: float
    intercept: float

    def __call__(self, value: float) -> float:
        """The probability; values far out are held, where exp would overflow."""
        return 1.0 / (1.0 + math.exp(-min(max(self.slope * value + self.intercept, -700.0), 700.0)))


@dataclass(frozen=True, slots=True, eq=False)
class ActivityModel:
    """Who hardly moves up and down stands; of the others the SVM tells turns from straight walking.

    `walking` takes `log_vertical_sd`; `turning` takes the SVM's decision (Platt's scaling).
    """

    features: str
    svm: Svm
    walking: Logistic
    turning: Logistic

    def judge(self, window: ActivityWindow) -> Activity:
        """The activity of a window, with the probability that it is right; a turn is where the SVM's decision is > 0.

        Platt's scaling need not cross one half where the decision crosses zero; the probability told is not below one
        half on either side.
        """
        walking = self.walking(log_vertical_sd(window))
        if walking < 0.5:
            return Activity(window.end_ns, ActivityKind.STANDING, 1.0 - walking, window.turn_rad)
        decision = float(self.svm.decision(FEATURES[self.features](window)[None, :])[0])
        turning = self.turning(decision)
        if decision > 0.0:
            return Activity(window.end_ns, ActivityKind.TURNING, walking * max(turning, 0.5), window.turn_rad)
        return Activity(window.end_ns, ActivityKind.STRAIGHT, walking * max(1.0 - turning, 0.5), window.turn_rad)


class ActivityRecogniser:
    """Takes one person's samples and tells the activity of each window as it ends."""

    def __init__(self, model: ActivityModel) -> None:
        self._model = model
        self._stream = WindowStream()

    def push(self, stamp_ns: int, heading_rad: float, force_m_s2: Vector3) -> Activity | None:
        """Take the waist's heading and the specific force of a sample; return the activity of the window it ends."""
        window = self._stream.push(stamp_ns, heading_rad, force_m_s2)
        return None if window is None else self._model.judge(window)
