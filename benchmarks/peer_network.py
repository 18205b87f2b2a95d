"""The paper's network as peers write it: as in a tutorial, and laid out for a CPU."""

from __future__ import annotations

from typing import ClassVar

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from benchmarks.work import FRAME


def conv_layers() -> nn.ModuleList:
    """Return the four conv layers of section 3.5: from 84x84 grey pixels to 200 features."""
    layers = [nn.Conv2d(1, 32, 8, stride=4), nn.Conv2d(32, 64, 4, stride=2)]
    return nn.ModuleList([*layers, nn.Conv2d(64, 64, 3), nn.Conv2d(64, 200, 7)])


class DuelingHead(nn.Module):
    """From 200 features to Q-values: a shared layer, then value and advantage."""

    def __init__(self, num_actions: int) -> None:
        super().__init__()
        self.shared = nn.Linear(200, 200)
        self.value = nn.Linear(200, 1)
        self.advantage = nn.Linear(200, num_actions)

    def forward(self, features: Tensor) -> Tensor:
        """Map float [..., 200] to [..., A]."""
        x = F.relu(self.shared(features))
        advantage = self.advantage(x)
        return self.value(x) + advantage - advantage.mean(-1, keepdim=True)


class PlainNetwork(nn.Module):
    """PyTorch's own layers in their own layout."""

    def __init__(self, num_actions: int) -> None:
        super().__init__()
        self.convs = conv_layers()
        self.head = DuelingHead(num_actions)

    def forward(self, pixels: Tensor) -> Tensor:
        """Map uint8 [..., 1, 84, 84] or [..., 84, 84, 1] to float [..., A]."""
        # With one channel the two layouts are the same bytes.
        x = pixels.reshape(*pixels.shape[:-3], *FRAME) / 255.0
        for conv in self.convs:
            x = F.relu(conv(x))
        return self.head(x.flatten(-3))


class TunedNetwork(nn.Module):
    """The same function, laid out for a CPU: channels last, and no convolution where a product will do.

    The first convolution reads 4x4 blocks of pixels as 16 channels (`to_blocks`). The last one covers its
    whole input, so it is a linear layer. The weights are those of `PlainNetwork` in another order.
    """

    places: ClassVar[int] = 21

    def __init__(self, num_actions: int) -> None:
        super().__init__()
        convs = [nn.Conv2d(16, 32, 2), *conv_layers()[1:3]]
        self.convs = nn.ModuleList([*convs, nn.Linear(49 * 64, 200)])
        self.head = DuelingHead(num_actions)
        for conv in convs:
            conv.weight.data = conv.weight.data.contiguous(memory_format=torch.channels_last)

    def forward(self, blocks: Tensor) -> Tensor:
        """Map uint8 [B, 21, 21, 16] to float [B, A]."""
        # One pass converts to the type that the convolution computes in.
        x = blocks.to(torch.get_autocast_dtype("cpu") if torch.is_autocast_enabled("cpu") else torch.float32)
        x = (x * (1 / 255)).permute(0, 3, 1, 2)
        for conv in self.convs[:3]:
            x = F.relu_(conv(x))
        x = F.relu_(self.convs[3](x.permute(0, 2, 3, 1).flatten(1)))
        return self.head(x)


def to_blocks(pixels: Tensor) -> Tensor:
    """Move 4x4 blocks of pixels into channels: uint8 [..., 84, 84] to [..., 21, 21, 16]."""
    shape, places = pixels.shape[:-2], TunedNetwork.places
    split = pixels.reshape(*shape, places, 4, places, 4)
    return split.transpose(-3, -2).reshape(*shape, places, places, 16)
