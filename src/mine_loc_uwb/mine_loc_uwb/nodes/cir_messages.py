"""CIR frames of the graph to arrays for the classifier, and its judgements to messages."""

from collections.abc import Sequence

import numpy as np
from mine_loc_interfaces.msg import CirFrame, LinkState

from mine_loc_uwb.cir_frames import CirFrames
from mine_loc_uwb.link_judgement import Judgement


def tap_count(message: CirFrame) -> int:
    """Taps that a message holds; 0 if its two halves differ in length."""
    count = len(message.in_phase)
    return count if count == len(message.quadrature) else 0


def to_cir_frames(messages: Sequence[CirFrame]) -> CirFrames:
    """Frames of messages with the same `tap_count`."""
    taps = tap_count(messages[0])
    samples = np.empty((len(messages), taps, 2), np.int16)
    for row, message in zip(samples, messages, strict=True):
        row[:, 0] = np.frombuffer(message.in_phase, np.int16)[:taps]
        row[:, 1] = np.frombuffer(message.quadrature, np.int16)[:taps]

    def column(name: str) -> np.ndarray:
        return np.array([getattr(message, name) for message in messages], float)

    return CirFrames(
        samples=samples,
        start_index=column("start_index").astype(int),
        first_path_index=column("first_path_index"),
        symbols=column("preamble_count"),
        noise_std=column("noise_std"),
        receive_power_dbm=column("receive_power"),
        first_path_power_dbm=column("first_path_power"),
        range_m=column("range"),
        channel=column("channel").astype(int),
    )


def to_link_state(frame: CirFrame, judged: Judgement) -> LinkState:
    """Judgement of a frame, with the frame's stamp, ids and round."""
    message = LinkState(
        tag_id=frame.tag_id,
        anchor_id=frame.anchor_id,
        range_seq=frame.range_seq,
        most_likely_class=judged.most_likely_class,
        class_probability=judged.class_probability,
        los_probability=judged.los_probability,
        refusal=int(judged.refusal),
        method=int(judged.method),
    )
    message.header = frame.header
    return message
