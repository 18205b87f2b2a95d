"""Remember what frozen layers make of a state: computed once, when the state is stored.

If only linear layers learn, the replay stores features next to states: slow to compute, quick to read. In the
paper's network they are 3,136 numbers after the third layer (6 kB in half precision, a little less than a
frame), and 200 after the fourth.
"""

from __future__ import annotations

import torch
from torch import Tensor

from ship_trl.learn.backend import Draw
from ship_trl.learn.network import DuelingNetwork


class FrozenFeatures:
    """Maps states [N, S] to what the frozen layers compute, [N, K] in half precision.

    Args:
        network: at least its first `linear_from` layers are frozen.
        draw: maps states to pixels.
        precision: of the conv layers in training.

    Attributes:
        dtype: half precision of the features.
    """

    def __init__(self, network: DuelingNetwork, draw: Draw, precision: torch.dtype) -> None:
        self.network, self.draw = network, draw
        # float16 has three more bits of mantissa than bfloat16, so it is better for float32 results.
        self.dtype = torch.bfloat16 if precision is torch.bfloat16 else torch.float16

    @torch.no_grad()
    def __call__(self, state: Tensor) -> Tensor:
        """Compute the features of states."""
        layers = self.network.frozen
        # One by one, so that the bits do not depend on the batch: a resumed run recomputes the features.
        features = torch.cat([self.network.encode(self.draw(one), layers) for one in state.split(1)])
        # float16 would store values above 65,504 as infinity. After ReLU no value is negative.
        return features.clamp_(max=torch.finfo(self.dtype).max).to(self.dtype)
