"""The trained network in live use."""

import numpy as np
import torch
from numpy.typing import NDArray

from mine_loc_core.errors import ConfigurationError
from mine_loc_uwb.cir_input import LosInput
from mine_loc_uwb.los_network import LosNetwork


class TorchClassifier:
    """Class probabilities of inputs; on the processor with one thread, on a GPU if asked."""

    def __init__(self, network: LosNetwork, device: str = "cpu") -> None:
        if device == "cuda" and not torch.cuda.is_available():
            raise ConfigurationError("device: cuda is not available here; allowed: cpu")
        torch.set_num_threads(1)
        self._device = torch.device(device)
        self._network = network.to(self._device).eval()

    @torch.inference_mode()
    def __call__(self, given: LosInput) -> NDArray[np.float64]:
        """Probabilities (n, 4) of classes 1 to 4."""
        tensors = (torch.from_numpy(each).to(self._device) for each in (given.profile, given.edge, given.side))
        return np.asarray(self._network(*tensors).exp().cpu().numpy(), float)
