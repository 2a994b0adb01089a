"""The step network trained for each person on the twelve others: every figure of ipol is of people it has not seen."""

from collections.abc import Mapping, Sequence

import torch
from pdr_recordings import START_NS, Recording
from pdr_tracks import HALT_S, samples

from mine_loc_core.stamps import NS_PER_S
from mine_loc_pdr.marked_motion import MarkedMotion, marked_motion
from mine_loc_pdr.step_kernel import Floats
from mine_loc_pdr.step_training import train


def held_out_weights(recordings: Sequence[Recording]) -> Mapping[str, Floats]:
    """For each person the network of the others."""
    torch.set_num_threads(1)
    walks = [(recording.person, _marked(recording)) for recording in recordings]
    people = dict.fromkeys(person for person, _ in walks)
    return {person: train([motion for who, motion in walks if who != person]) for person in people}


def _marked(recording: Recording) -> MarkedMotion:
    end_s = recording.bouts[0][1] + HALT_S
    return marked_motion(samples(recording), START_NS + recording.strikes_s * NS_PER_S, START_NS + end_s * NS_PER_S)
