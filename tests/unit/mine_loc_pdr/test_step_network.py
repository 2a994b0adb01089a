"""The network of steps: its compiled form agrees with torch, and a short training learns what it is told."""

import numpy as np
import pytest
import torch

from mine_loc_pdr.marked_motion import MarkedMotion
from mine_loc_pdr.step_detector import LOOKAHEAD_S
from mine_loc_pdr.step_frames import CHANNELS
from mine_loc_pdr.step_kernel import REACH, WEIGHTS, StepStream, weights_of
from mine_loc_pdr.step_network import StepNetwork
from mine_loc_pdr.step_training import train


@pytest.fixture
def network():
    torch.manual_seed(1)
    return StepNetwork().eval()


def noise(frames, seed=0):
    return np.random.default_rng(seed).normal(0.0, 2.0, (frames, CHANNELS))


def streamed(weights, frames):
    stream = StepStream(weights)
    return np.array([stream.push(frame) for frame in frames])


def test_the_stream_is_the_network_frame_by_frame(network):
    frames = noise(4 * REACH)
    with torch.no_grad():
        expected = network(torch.from_numpy(frames.astype(np.float32))[None])[0].numpy()
    weights = weights_of(network.state_dict())
    assert weights.shape == (WEIGHTS,)
    np.testing.assert_allclose(streamed(weights, frames), expected, atol=2e-5)


def test_an_output_sees_so_many_frames_and_no_more(network):
    weights = weights_of(network.state_dict())
    one, other = noise(3 * REACH, 1), noise(3 * REACH, 2)
    other[REACH:] = one[REACH:]
    np.testing.assert_allclose(
        streamed(weights, one)[2 * REACH - 1 :], streamed(weights, other)[2 * REACH - 1 :], atol=1e-5
    )
    assert streamed(weights, one)[2 * REACH - 2] != pytest.approx(streamed(weights, other)[2 * REACH - 2], abs=1e-9)


def test_a_reset_stream_is_a_new_one(network):
    weights = weights_of(network.state_dict())
    stream = StepStream(weights)
    for frame in noise(50):
        stream.push(frame)
    stream.reset()
    np.testing.assert_array_equal([stream.push(frame) for frame in noise(50, 3)], streamed(weights, noise(50, 3)))


def walk(seed):
    """Vertical and level motion of somebody who takes a step every 0.5 s from the second second on."""
    times_s = np.arange(1500) * 0.02
    frames = 0.05 * noise(len(times_s), seed)
    walking = times_s > 2.0
    frames[:, 0] += np.where(walking, 2.5 * np.sin(2 * np.pi * 2.0 * times_s), 0.0)
    frames[:, 2] += np.where(walking, 1.5 * np.sin(2 * np.pi * times_s), 0.0)
    frames[:, 3] += np.where(walking, 0.5 * np.cos(2 * np.pi * times_s), 0.0)
    return MarkedMotion(frames, np.arange(2.0, 29.0, 0.5) + 0.06, 30.0)


def test_training_finds_the_strikes_of_another_walk_and_repeats_itself():
    weights = train([walk(0), walk(1)], rounds=12)
    np.testing.assert_array_equal(weights, train([walk(0), walk(1)], rounds=12))
    unseen = walk(2)
    logits = streamed(weights, unseen.frames)
    after = np.round((unseen.strikes_s + LOOKAHEAD_S) / 0.02).astype(int)
    between = after + 12
    inside = after[4:-4], between[4:-4]
    assert logits[inside[0]].min() > logits[inside[1]].max()
    assert logits[:80].max() < np.median(logits[inside[0]])
