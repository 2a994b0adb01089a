"""Training of the LOS network on frames of few placements: balanced by placement, augmented, stopped in time.

How long to train, and the temperature that makes probabilities honest, come from inner folds over the placements of
the training set (`select`); the network itself is then trained on all of them (`train`).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from mine_loc_uwb.cir_input import LEVEL_FEATURES, RANGE_FEATURES, LosInput
from mine_loc_uwb.los_augmentation import augmented, without
from mine_loc_uwb.los_calibration import fit_temperature
from mine_loc_uwb.los_evidence import fit_evidence
from mine_loc_uwb.los_network import LosNetwork
from mine_loc_uwb.training_set import Sampler, TrainingSet, balanced_weights

_CHUNK = 4096
Progress = Callable[[int], None]


@dataclass(frozen=True, slots=True)
class TrainingOptions:
    """How to train. The defaults suit tens of placements; thousands of links take more steps and no caution."""

    steps: int = 120
    check_every: int = 40
    batch: int = 64
    learning_rate: float = 4e-3
    weight_decay: float = 1e-2
    caution: float = 8.0
    """Price of what the network adds to the evidence, over the number of placements it can have learnt it from."""
    auxiliary_weight: float = 0.5
    hide_range: float = 0.5
    hide_levels: float = 0.25
    """Shares of frames whose range, or whose range and levels, are hidden, so that the network can do without."""
    augment: bool = True
    averaging: float = 0.97
    inner_folds: int = 3


@dataclass(frozen=True, slots=True, eq=False)
class Selection:
    """What the inner folds chose."""

    steps: int
    temperature: tuple[float, float]
    los_probability: tuple[NDArray[np.float64], NDArray[np.float64]]
    """P(LOS) of the held-out frames at that step, calibrated: with the range and without it."""
    los: NDArray[np.bool_]
    placement: NDArray[np.int64]


def to_tensors(given: LosInput) -> tuple[Tensor, Tensor, Tensor]:
    """Profile, edge and side of an input for the network."""
    return torch.from_numpy(given.profile), torch.from_numpy(given.edge), torch.from_numpy(given.side)


def negative_log_likelihood(log_probability: Tensor, allowed: Tensor) -> Tensor:
    """Mean cost of class log-probabilities (n, 4) whose true class is one of the allowed ones, (n, 4)."""
    return -torch.logsumexp(log_probability.masked_fill(~allowed, -torch.inf), dim=1).mean()


def train(
    data: TrainingSet,
    options: TrainingOptions,
    seed: int,
    auxiliary: TrainingSet | None = None,
    progress: Progress | None = None,
) -> Iterator[LosNetwork]:
    """Train a network; yields its averaged weights every `check_every` steps.

    auxiliary: simulated frames, whose levels are hidden, since a simulator's link budget is not that of a site.
    """
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    network, averaged = LosNetwork(), LosNetwork()
    network.standardise(torch.from_numpy(data.input.side))
    weights = balanced_weights(data.los, data.placement)
    network.evidence.set(fit_evidence(data.input.side.astype(float), data.los, weights))
    averaged.load_state_dict(network.state_dict())
    optimiser = torch.optim.AdamW(network.parameters(), options.learning_rate, weight_decay=options.weight_decay)
    sampler, tensors, allowed = Sampler(data, rng), to_tensors(data.input), torch.from_numpy(data.allowed)
    others = None if auxiliary is None else _Auxiliary(auxiliary, rng)
    caution = options.caution / sampler.placements
    for step in range(1, options.steps + 1):
        network.train()
        which = torch.from_numpy(sampler.draw(options.batch))
        batch = tuple(each[which] for each in tensors)
        if options.augment:
            batch = augmented(*batch)
        side = without(batch[2], RANGE_FEATURES, options.hide_range)
        side = without(side, LEVEL_FEATURES, options.hide_levels)
        batch = (batch[0], batch[1], side)
        read = network.read(*batch)
        loss = negative_log_likelihood(network.judge(read, batch[2]), allowed[which])
        loss = loss + caution * (read[:, 0] ** 2 * network.evidence(side).isfinite()).mean()
        if others is not None:
            loss = loss + options.auxiliary_weight * others.loss(network, options.batch)
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        _average(averaged, network, min(options.averaging, step / (step + 10)))
        if progress is not None:
            progress(1)
        if step % options.check_every == 0:
            averaged.eval()
            yield averaged


class _Auxiliary:
    def __init__(self, data: TrainingSet, rng: np.random.Generator) -> None:
        self._sampler, self._tensors = Sampler(data, rng), to_tensors(data.input)
        self._allowed = torch.from_numpy(data.allowed)

    def loss(self, network: LosNetwork, count: int) -> Tensor:
        which = torch.from_numpy(self._sampler.draw(count))
        profile, edge, side = augmented(*(each[which] for each in self._tensors))
        return negative_log_likelihood(network(profile, edge, without(side, LEVEL_FEATURES)), self._allowed[which])


@torch.no_grad()
def _average(averaged: LosNetwork, network: LosNetwork, keep: float) -> None:
    for mean, latest in zip(averaged.parameters(), network.parameters(), strict=True):
        mean.lerp_(latest, 1.0 - keep)


@torch.no_grad()
def log_probabilities(network: LosNetwork, given: LosInput) -> NDArray[np.float64]:
    """Class log-probabilities (n, 4) of a whole input."""
    chunks = [given.take(slice(first, first + _CHUNK)) for first in range(0, len(given), _CHUNK)]
    parts = [network(*to_tensors(chunk)) for chunk in chunks]
    return np.concatenate([part.numpy() for part in parts]).astype(float)


def los_probability(network: LosNetwork, given: LosInput) -> NDArray[np.float64]:
    """P(LOS) (n,) of a whole input."""
    return np.asarray(np.exp(log_probabilities(network, given)[:, 2:]).sum(axis=1))


def inner_folds(data: TrainingSet, folds: int, seed: int) -> list[NDArray[np.int64]]:
    """Placements to hold out in each inner fold: LOS and NLOS ones dealt out evenly, in random order."""
    rng = np.random.default_rng(seed)
    places, first = np.unique(data.placement, return_index=True)
    los = data.los[first]
    dealt = np.concatenate([rng.permutation(places[los]), rng.permutation(places[~los])])
    return [dealt[fold::folds] for fold in range(folds)]


@dataclass(frozen=True, slots=True, eq=False)
class HeldOut:
    """LOS logits at each check, (checks, n), with and without range, of frames a network never saw; their labels."""

    logits: NDArray[np.float64]
    logits_no_range: NDArray[np.float64]
    los: NDArray[np.bool_]
    placement: NDArray[np.int64]


def held_out(
    data: TrainingSet,
    places: NDArray[np.int64],
    options: TrainingOptions,
    seed: int,
    auxiliary: TrainingSet | None = None,
    progress: Progress | None = None,
) -> HeldOut:
    """Train without some placements and judge them."""
    out = np.isin(data.placement, places)
    rest, kept = data.take(~out), data.take(out)
    blind = kept.input.without_range()
    logits = [
        (_logit(los_probability(network, kept.input)), _logit(los_probability(network, blind)))
        for network in train(rest, options, seed, auxiliary, progress)
    ]
    seen, unseen = (np.stack(column) for column in zip(*logits, strict=True))
    return HeldOut(seen, unseen, kept.los, kept.placement)


def select(judged: list[HeldOut], options: TrainingOptions) -> Selection:
    """Choose the number of steps with the least cost on held-out placements, and the temperatures there.

    Costs weigh LOS and NLOS, and the placements of each, the same.
    """
    los, placement = (np.concatenate([getattr(each, name) for each in judged]) for name in ("los", "placement"))
    weight = balanced_weights(los, placement)
    both = [np.concatenate([getattr(each, name) for each in judged], axis=1) for name in ("logits", "logits_no_range")]
    sign = np.where(los, 1.0, -1.0)
    losses = sum(np.logaddexp(0.0, -sign * logits) @ weight for logits in both)
    best = int(np.argmin(losses))
    warm = (fit_temperature(both[0][best], los, weight), fit_temperature(both[1][best], los, weight))
    calm = [1.0 / (1.0 + np.exp(-logits[best] / warmth)) for logits, warmth in zip(both, warm, strict=True)]
    return Selection((best + 1) * options.check_every, warm, (calm[0], calm[1]), los, placement)


def _logit(probability: NDArray[np.float64]) -> NDArray[np.float64]:
    kept = np.clip(probability, 1e-6, 1.0 - 1e-6)
    return np.asarray(np.log(kept) - np.log1p(-kept))
