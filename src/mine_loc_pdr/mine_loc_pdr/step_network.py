"""The network that sees heel strikes in frames of motion: causal dilated convolutions.

Bai, Kolter, Koltun, "An Empirical Evaluation of Generic Convolutional and Recurrent Networks for Sequence Modeling",
arXiv:1803.01271. Its output at a frame is the logit of a strike LOOKAHEAD_S before the frame's end.
"""

import torch
from torch import Tensor, nn

from mine_loc_pdr.step_frames import CHANNELS
from mine_loc_pdr.step_kernel import DILATIONS, SCALE, TAPS, WIDTH


class StepNetwork(nn.Module):
    """Logits (batch, frames) of frames (batch, frames, CHANNELS)."""

    scale: Tensor

    def __init__(self) -> None:
        super().__init__()
        inputs = (CHANNELS, *[WIDTH] * (len(DILATIONS) - 1))
        self.layers = nn.ModuleList(
            nn.Conv1d(n, WIDTH, TAPS, dilation=d) for n, d in zip(inputs, DILATIONS, strict=True)
        )
        self.head = nn.Linear(WIDTH, 1)
        self.register_buffer("scale", torch.from_numpy(SCALE), persistent=False)

    def forward(self, frames: Tensor) -> Tensor:
        """See the class."""
        values = (frames / self.scale).transpose(1, 2)
        for layer, dilation in zip(self.layers, DILATIONS, strict=True):
            seen = torch.relu(layer(nn.functional.pad(values, ((TAPS - 1) * dilation, 0))))
            values = seen + values if seen.shape == values.shape else seen
        logits: Tensor = self.head(values.transpose(1, 2))[..., 0]
        return logits
