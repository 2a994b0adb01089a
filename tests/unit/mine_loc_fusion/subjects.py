"""The default estimator after a walk, and what can be read of it."""

import math
import pickle

from walks import Walk

from mine_loc_fusion.tightly_coupled import TightlyCoupled


def walked(seconds=30.0, subject=None, **walk):
    """Somebody who has walked for so long, and the walk."""
    walk, subject = Walk(**walk), subject or TightlyCoupled()
    walk.play(subject, seconds)
    return subject, walk


def own(subject, which):
    """Value and standard deviation of one of its own states."""
    place = subject._own + which
    return float(subject._tracker.x[place]), math.sqrt(subject._tracker.P[place, place])


def state_bytes(subject):
    """All that it knows, as bytes."""
    saved = vars(subject.save()).copy()
    saved["_tracker"] = vars(saved["_tracker"])
    return pickle.dumps({name: value for name, value in saved.items() if name != "_s"})


def reasons(verdicts):
    return [verdict.reason for verdict in verdicts]
