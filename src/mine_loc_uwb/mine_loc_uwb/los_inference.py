"""The trained network in live use by torch, for a GPU; `los_kernel` is for the processor."""

import warnings

import numpy as np
import torch
from numpy.typing import NDArray

from mine_loc_core.errors import ConfigurationError
from mine_loc_uwb.cir_input import CHANNELS, EDGE_PER_TAP, EDGE_TAPS, SIDE_NAMES, TAPS, LosInput
from mine_loc_uwb.los_network import LosNetwork


def _recorded(network: LosNetwork, device: torch.device) -> torch.nn.Module:
    """The network as a recorded graph, which spares Python half of the time a single frame takes."""
    sizes = ((1, CHANNELS, TAPS), (1, EDGE_TAPS * EDGE_PER_TAP), (1, 2 * len(SIDE_NAMES)))
    example = tuple(torch.zeros(size, device=device) for size in sizes)
    with warnings.catch_warnings(), torch.inference_mode():
        warnings.simplefilter("ignore")  # that a batch of another size is another graph: not here, a test compares
        recorded: torch.nn.Module = torch.jit.freeze(
            torch.jit.trace(network, example, check_trace=False)  # type: ignore[no-untyped-call]
        )
    return recorded


class TorchClassifier:
    """Class probabilities of inputs; on the processor with one thread, on a GPU if asked."""

    def __init__(self, network: LosNetwork, device: str = "cpu") -> None:
        if device == "cuda" and not torch.cuda.is_available():
            raise ConfigurationError("device: cuda is not available here; allowed: cpu")
        torch.set_num_threads(1)
        self._device = torch.device(device)
        self._network = _recorded(network.to(self._device).eval(), self._device)

    @torch.inference_mode()
    def __call__(self, given: LosInput) -> NDArray[np.float64]:
        """Probabilities (n, 4) of classes 1 to 4."""
        tensors = (torch.from_numpy(each).to(self._device) for each in (given.profile, given.edge, given.side))
        return np.asarray(self._network(*tensors).exp().cpu().numpy(), float)
