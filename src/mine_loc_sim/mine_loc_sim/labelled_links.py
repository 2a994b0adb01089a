"""Receptions over single links drawn without a scene: what a classifier can be trained on beside real ones.

A third of the links is clear, a third crosses something, a third only goes round rock; half see the channels of
industry (CM7 and CM8), half those of buildings.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mine_loc_sim.dw1000_accumulator import Receiver
from mine_loc_sim.link_channel import LinkChannel, Obstruction
from mine_loc_sim.radio_constants import INDUSTRIAL, OFFICE
from mine_loc_sim.ranging_link import Exchanges, exchange
from mine_loc_sim.tag_radio import CHANNEL
from mine_loc_uwb.cir_frames import CirFrames, concatenate

DISTANCE_M = (1.0, 25.0)
CROSSED_LOSS_DB, CROSSED_DELAY_M, CROSSED_DETOUR_M = (3.0, 25.0), (0.05, 0.6), (0.05, 3.0)
"""A wearer's body, a person, a wall of a building: the range of `radio_constants`."""
ROCK_LOSS_DB, ROCK_DETOUR_M = 300.0, (1.0, 15.0)
_CHUNK = 1000


@dataclass(frozen=True, slots=True, eq=False)
class LabelledLinks:
    """`n` receptions that a first path was found in, and their class, (n,)."""

    frames: CirFrames
    link_class: NDArray[np.int64]


def draw_links(count: int, seed: int) -> LabelledLinks:
    """Draw about `count` receptions, each over a link of its own; those that are lost are left out."""
    rng = np.random.default_rng(seed)
    chunks = [_draw(min(_CHUNK, count - first), number, rng) for number, first in enumerate(range(0, count, _CHUNK))]
    return LabelledLinks(
        concatenate([chunk.frames for chunk in chunks]), np.concatenate([chunk.link_class for chunk in chunks])
    )


def _draw(count: int, number: int, rng: np.random.Generator) -> LabelledLinks:
    way = _obstruction(count, rng)
    channel = LinkChannel((INDUSTRIAL, OFFICE)[number % 2], count, rng)
    batch = channel.respond(np.arange(count)[None], np.zeros((1, count)), way)
    found = exchange(batch, way.loss_db, Receiver.draw(count, rng), Receiver.draw(count, rng), rng)
    heard = np.flatnonzero(np.isfinite(found.error_m) & found.registers.detected)
    return LabelledLinks(received_frames(found, way.distance_m + found.error_m, heard), found.link_class[heard])


def _obstruction(count: int, rng: np.random.Generator) -> Obstruction:
    kind = rng.integers(3, size=count)
    crossed, rock = kind == 1, kind == 2
    detour_m = np.where(crossed, rng.uniform(*CROSSED_DETOUR_M, count), 0.0)
    return Obstruction(
        distance_m=DISTANCE_M[0] * (DISTANCE_M[1] / DISTANCE_M[0]) ** rng.random(count),
        loss_db=np.where(crossed, rng.uniform(*CROSSED_LOSS_DB, count), rock * ROCK_LOSS_DB),
        delay_m=np.where(crossed, rng.uniform(*CROSSED_DELAY_M, count), 0.0),
        detour_m=np.where(rock, rng.uniform(*ROCK_DETOUR_M, count), detour_m),
        further_loss_db=np.zeros(count),
        sealed=rock,
    )


def received_frames(found: Exchanges, range_m: NDArray[np.float64], which: NDArray[np.int64]) -> CirFrames:
    """Accumulators and registers of some receptions at the tag as a driver would give them; range_m: (n,) of all."""
    samples, registers = found.reception.samples[which], found.registers
    iq = np.stack([samples.real, samples.imag], axis=-1).clip(-32768, 32767).astype(np.int16)
    return CirFrames(
        samples=iq,
        start_index=np.zeros(len(which), int),
        first_path_index=registers.first_path_index[which],
        symbols=registers.rxpacc[which].astype(float),
        noise_std=registers.noise_std[which].astype(float),
        receive_power_dbm=registers.receive_power_dbm[which],
        first_path_power_dbm=registers.first_path_power_dbm[which],
        range_m=range_m[which],
        channel=np.full(len(which), CHANNEL),
    )
