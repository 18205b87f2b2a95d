"""The paper's network: four conv layers, three fully connected, dueling (figure 3)."""

from __future__ import annotations

from collections.abc import Collection
from typing import Protocol

import torch
import torch.nn.functional as F
from torch import Generator, Tensor, nn

CONV_NAMES = ("conv1", "conv2", "conv3", "conv4")


class DuelingNetwork(nn.Module):
    """Q-values of all actions from pixels: uint8 [B, C, 84, 84] to float32 [B, A].

    Section 3.5: conv 32@8x8/4, 64@4x4/2, 64@3x3/1, 200@7x7/1, each with ReLU, giving 200 features.
    "Fully connected layers with a dueling structure" is all it says of the rest; ours are
    200 -> 200 shared, then value (1) and advantage (A).

    Args:
        channels: 1 (grey) or 3 (colour).
        num_actions: A.
        generator: source of the initial weights.

    `backend` computes the conv layers, and may be replaced at any time: all give the same function.
    `frozen` counts the conv layers, from the image on, that do not learn (see `freeze`).
    """

    frozen = 0

    def __init__(self, channels: int, num_actions: int, generator: Generator) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(channels, 32, 8, stride=4)
        self.conv2 = nn.Conv2d(32, 64, 4, stride=2)
        self.conv3 = nn.Conv2d(64, 64, 3)
        self.conv4 = nn.Conv2d(64, 200, 7)
        self.shared = nn.Linear(200, 200)
        self.value = nn.Linear(200, 1)
        self.advantage = nn.Linear(200, num_actions)
        # Channels last throughout: oneDNN then computes on the activations as they lie.
        for name in CONV_NAMES:
            weight = getattr(self, name).weight
            weight.data = weight.data.contiguous(memory_format=torch.channels_last)
        self.backend: Backend = Dense()
        self.reset(generator)

    def freeze(self, layers: int) -> None:
        """Let the first `layers` conv layers learn nothing."""
        for name in CONV_NAMES[:layers]:
            getattr(self, name).requires_grad_(False)
        self.frozen = layers

    def conv_weights(self) -> list[Tensor]:
        """Weight and bias of each conv layer, from the image on."""
        layers = [getattr(self, name) for name in CONV_NAMES]
        return [weight for layer in layers for weight in (layer.weight, layer.bias)]

    @torch.no_grad()
    def reset(self, generator: Generator, kept: Collection[str] = ()) -> None:
        """Draw weights anew (He et al., 2015) and set biases to zero, of all layers but those `kept`.

        PyTorch's default shrinks the signal to a third at each ReLU layer; the first hundred
        episodes then go into growing it again.
        """
        for name, layer in self.named_children():
            if name in kept:
                continue
            assert isinstance(layer, nn.Conv2d | nn.Linear) and layer.bias is not None
            nn.init.kaiming_uniform_(layer.weight, nonlinearity="relu", generator=generator)
            nn.init.zeros_(layer.bias)

    def forward(self, observation: Tensor) -> Tensor:
        """Compute the Q-values of all actions, float32 [..., A].

        Args:
            observation: pixels, uint8 [..., C, 84, 84], or what the frozen layers made of them, in half
                precision or float32 [..., F].
        """
        drawn = observation.dtype is torch.uint8
        compute, dims = (self.backend.features if drawn else self.backend.features_from), 3 if drawn else 1
        if observation.dim() == dims + 1:
            return self.dueling(compute(self, observation))
        shape = observation.shape[:-dims]
        q = self.dueling(compute(self, observation.reshape(-1, *observation.shape[-dims:])))
        return q.reshape(*shape, self.advantage.out_features)

    def convolve(self, pixels: Tensor) -> Tensor:
        """Compute all conv layers: uint8 [B, C, 84, 84] to [B, 200]."""
        x = F.relu_(self._first(pixels))
        x = F.relu_(self.conv2(x))
        x = F.relu_(self.conv3(x))
        # Both sides lie channels last, so these are views.
        return self._last(x.permute(0, 2, 3, 1).flatten(1))

    def convolve_from(self, kept: Tensor) -> Tensor:
        """Compute the conv layers after the frozen ones, three or four: [B, F] to [B, 200]."""
        return kept if self.frozen == len(CONV_NAMES) else self._last(kept)

    def _last(self, x: Tensor) -> Tensor:
        """conv4: a 7x7 convolution of a 7x7 map is a linear layer, the same function and faster."""
        weight = self.conv4.weight.permute(0, 2, 3, 1).flatten(1)
        return F.relu_(F.linear(x, weight, self.conv4.bias))

    def dueling(self, features: Tensor) -> Tensor:
        """Fully connected layers: features [B, 200] to Q-values [B, A]."""
        x = F.relu_(self.shared(features))
        advantage = self.advantage(x)
        return self.value(x) + advantage - advantage.mean(-1, keepdim=True)

    def best(self, features: Tensor) -> Tensor:
        """Choose the actions of the highest Q-values: features [B, 200] to int64 [B].

        The value is the same for all actions, so advantages decide.
        """
        return self.advantage(F.relu_(self.shared(features))).argmax(-1)

    def _first(self, pixels: Tensor) -> Tensor:
        """conv1 as space-to-depth and a 2x2 convolution: the same function, faster on a CPU."""
        batch, channels, height, width = pixels.shape
        blocks = pixels.reshape(batch, channels, height // 4, 4, width // 4, 4)
        blocks = blocks.permute(0, 2, 4, 1, 3, 5).reshape(batch, height // 4, width // 4, channels * 16)
        blocks = (blocks.to(self.conv1.weight.dtype) * (1.0 / 255.0)).permute(0, 3, 1, 2)
        weight = self.conv1.weight.reshape(-1, channels, 2, 4, 2, 4)
        weight = weight.permute(0, 2, 4, 1, 3, 5).reshape(-1, 2, 2, channels * 16).permute(0, 3, 1, 2)
        return F.conv2d(blocks, weight, self.conv1.bias)


class Backend(Protocol):
    """Computes conv layers. It holds no weights, so that networks may share it."""

    def features(self, network: DuelingNetwork, pixels: Tensor) -> Tensor:
        """Compute all conv layers: uint8 [B, C, 84, 84] to float32 [B, 200]."""
        ...

    def features_from(self, network: DuelingNetwork, kept: Tensor) -> Tensor:
        """Compute those after the frozen ones: [B, F] to float32 [B, 200]."""
        ...

    def prepare(self, network: DuelingNetwork) -> None:
        """Do what can be done as soon as weights have changed; nothing depends on it but time."""
        ...


class Dense:
    """Computes every layer on every pixel, on any device: a pure function of weights and batch.

    Args:
        dtype: of the conv layers. bfloat16 goes by autocast; weights and gradients stay float32.
    """

    def __init__(self, dtype: torch.dtype = torch.float32) -> None:
        self.dtype = dtype

    def features(self, network: DuelingNetwork, pixels: Tensor) -> Tensor:
        """Compute all conv layers."""
        with torch.autocast(pixels.device.type, torch.bfloat16, enabled=self.dtype is torch.bfloat16):
            found = network.convolve(pixels)
        # Where values are large, actions differ by less than bfloat16 can tell.
        return found.float()

    def features_from(self, network: DuelingNetwork, kept: Tensor) -> Tensor:
        """Compute those after the frozen ones."""
        with torch.autocast(kept.device.type, torch.bfloat16, enabled=self.dtype is torch.bfloat16):
            found = network.convolve_from(kept.float())
        return found.float()

    def prepare(self, network: DuelingNetwork) -> None:
        """Do nothing: weights are read as they are."""
