"""The paper's network as peers write it: plainly, and laid out for a CPU."""

from __future__ import annotations

from typing import ClassVar

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from ship_trl.bench.work import CONV_LAYERS, FRAME


def conv_layers(channels: int = 1) -> list[nn.Conv2d]:
    """Compute the four conv layers of section 3.5, from 84x84 to 200 features."""
    return [
        nn.Conv2d(channels, 32, 8, stride=4),
        nn.Conv2d(32, 64, 4, stride=2),
        nn.Conv2d(64, 64, 3),
        nn.Conv2d(64, 200, 7),
    ]


class DuelingHead(nn.Module):
    """200 features to Q-values: a shared layer, then value and advantage."""

    def __init__(self, num_actions: int) -> None:
        super().__init__()
        self.shared = nn.Linear(200, 200)
        self.value = nn.Linear(200, 1)
        self.advantage = nn.Linear(200, num_actions)

    def forward(self, features: Tensor) -> Tensor:
        """Float [..., 200] to [..., A]."""
        x = F.relu(self.shared(features))
        advantage = self.advantage(x)
        return self.value(x) + advantage - advantage.mean(-1, keepdim=True)


class PlainNetwork(nn.Module):
    """As in any tutorial: uint8 [..., 1, 84, 84] or [..., 84, 84, 1] to float [..., A]."""

    def __init__(self, num_actions: int) -> None:
        super().__init__()
        self.convs = nn.ModuleList(conv_layers())
        self.head = DuelingHead(num_actions)

    def forward(self, pixels: Tensor) -> Tensor:
        """Q-values of all actions."""
        # With one channel the two layouts are the same bytes.
        x = pixels.reshape(*pixels.shape[:-3], *FRAME) / 255.0
        for conv in self.convs:
            x = F.relu(conv(x))
        return self.head(x.flatten(-3))


class TunedNetwork(nn.Module):
    """The same function of `blocks(pixels)`, laid out for a CPU.

    The first convolution reads 4x4 blocks of pixels as 16 channels, the last one covers its whole
    input and is a linear layer; all is channels last. The weights stand for those of the plain
    network, number for number.
    """

    places: ClassVar[int] = 21

    def __init__(self, num_actions: int) -> None:
        super().__init__()
        first = nn.Conv2d(16, 32, 2)
        _, second, third, _ = conv_layers()
        self.convs = nn.ModuleList([first, second, third, nn.Linear(49 * 64, 200)])
        self.head = DuelingHead(num_actions)
        for conv in (first, second, third):
            conv.weight.data = conv.weight.data.contiguous(memory_format=torch.channels_last)

    def forward(self, blocked: Tensor) -> Tensor:
        """Q-values of all actions: uint8 [B, 21, 21, 16] to float [B, A]."""
        # To the type that the convolution computes in, in one pass.
        x = blocked.to(torch.get_autocast_dtype("cpu") if torch.is_autocast_enabled("cpu") else torch.float32)
        x = (x * (1 / 255)).permute(0, 3, 1, 2)
        for conv in self.convs[:3]:
            x = F.relu_(conv(x))
        x = F.relu_(self.convs[3](x.permute(0, 2, 3, 1).flatten(1)))
        return self.head(x)


def blocks(pixels: Tensor) -> Tensor:
    """4x4 blocks of pixels as channels, last: uint8 [..., 84, 84] to [..., 21, 21, 16]."""
    shape, places = pixels.shape[:-2], TunedNetwork.places
    split = pixels.reshape(*shape, places, 4, places, 4)
    return split.transpose(-3, -2).reshape(*shape, places, places, 16)


def freeze(convs: nn.ModuleList, count: int) -> None:
    """Fix the first `count` conv layers.

    Raises:
        ValueError: `count` is not 0 to 4.
    """
    if not 0 <= count <= CONV_LAYERS:
        raise ValueError(f"frozen: must be 0 to {CONV_LAYERS}, got {count}")
    for conv in convs[:count]:
        conv.requires_grad_(False)
