"""The dueling network: conv layers, then fully connected ones (figure 3)."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any, Protocol

import torch
import torch.nn.functional as F
from torch import Generator, Tensor, nn

from ship_trl.config.network import geometry, linear_from, load_network
from ship_trl.config.types import Network


class DuelingNetwork(nn.Module):
    """Q-values of all actions from pixels: uint8 [B, C, 84, 84] to float32 [B, A].

    Section 3.5: conv layers with ReLU give F features (200 in the paper's network). The paper says of the
    rest only "fully connected layers with a dueling structure"; ours are one shared layer, then value (1)
    and advantage (A).

    Args:
        channels: 1 (grey) or 3 (colour).
        num_actions: A.
        generator: draws the initial weights.
        config: the layers; None for conf/network/paper.yaml.

    `conv_names` are `conv1` to the last; `geometry` has their windows and maps. Conv layers from index
    `linear_from` on (3 in the paper's network) see their whole map, so they are linear layers.
    `backend` computes the conv layers and may be replaced at any time: all backends compute the same
    function. `frozen` counts the conv layers, from the image on, that do not learn (see `freeze`).
    """

    frozen = 0

    def __init__(
        self, channels: int, num_actions: int, generator: Generator, config: Network | None = None
    ) -> None:
        super().__init__()
        self.config = config or load_network()
        self.geometry = geometry(self.config)
        self.linear_from = linear_from(self.geometry)
        self.conv_names = tuple(f"conv{n}" for n in range(1, len(self.geometry) + 1))
        for name, layer in zip(self.conv_names, self.geometry, strict=True):
            conv = nn.Conv2d(channels, layer.filters, layer.kernel, layer.stride)
            # Channels last throughout: oneDNN then needs no reordering of activations.
            conv.weight.data = conv.weight.data.contiguous(memory_format=torch.channels_last)
            self.add_module(name, conv)
            channels = layer.filters
        self.shared = nn.Linear(channels, self.config.hidden)
        self.value = nn.Linear(self.config.hidden, 1)
        self.advantage = nn.Linear(self.config.hidden, num_actions)
        self.backend: Backend = Dense()
        self.reset(generator)

    @property
    def convs(self) -> list[nn.Conv2d]:
        """The conv layers, from the image on."""
        return [getattr(self, name) for name in self.conv_names]

    def freeze(self, layers: int) -> None:
        """Freeze the first `layers` conv layers, and unfreeze the others.

        Raises:
            ValueError: the network has fewer conv layers.
        """
        if not 0 <= layers <= len(self.conv_names):
            raise ValueError(f"{len(self.conv_names)} conv layers can be frozen at most, got {layers}")
        for n, conv in enumerate(self.convs):
            conv.requires_grad_(n >= layers)
        self.frozen = layers

    def conv_weights(self) -> list[Tensor]:
        """Return weight and bias of each conv layer, from the image on."""
        weights: list[Any] = [weight for conv in self.convs for weight in (conv.weight, conv.bias)]
        return weights

    @torch.no_grad()
    def reset(self, generator: Generator, kept: Collection[str] = ()) -> None:
        """Draw new weights (He et al., 2015) and zero biases for all layers except those `kept`.

        PyTorch's default shrinks the signal to a third at each ReLU layer; the first hundred
        episodes would be spent growing it again.
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
            observation: pixels, uint8 [..., C, 84, 84], or features of the frozen layers, in half
                precision or float32 [..., K].
        """
        drawn = observation.dtype is torch.uint8
        compute, dims = (self.backend.features if drawn else self.backend.features_from), 3 if drawn else 1
        if observation.dim() == dims + 1:
            return self.dueling(compute(self, observation))
        shape = observation.shape[:-dims]
        q = self.dueling(compute(self, observation.reshape(-1, *observation.shape[-dims:])))
        return q.reshape(*shape, self.advantage.out_features)

    def convolve(self, pixels: Tensor) -> Tensor:
        """Compute all conv layers: uint8 [B, C, 84, 84] to [B, F]."""
        convs = self.convs
        x = F.relu_(self._first(pixels))
        for conv in convs[1 : self.linear_from]:
            x = F.relu_(conv(x))
        # Both are channels last, so these are views.
        return self._linear(x.permute(0, 2, 3, 1).flatten(1), convs[self.linear_from :])

    def activations(self, pixels: Tensor) -> dict[str, Tensor]:
        """Compute each layer's activations after ReLU: uint8 [B, C, 84, 84] to float32 by layer name.

        Conv layers give [B, filters, side, side], `shared` gives [B, hidden].
        """
        x = self._first(pixels)
        found: dict[str, Tensor] = {}
        for name, conv in zip(self.conv_names, self.convs, strict=True):
            x = F.relu(conv(x) if found else x)
            found[name] = x
        return found | {"shared": F.relu(self.shared(x.flatten(1)))}

    def convolve_from(self, kept: Tensor) -> Tensor:
        """Compute the conv layers after the frozen ones, at least `linear_from` of them: [B, K] to [B, F]."""
        return self._linear(kept, self.convs[self.frozen :])

    def _linear(self, x: Tensor, convs: list[nn.Conv2d]) -> Tensor:
        """Compute conv layers that see their whole map as linear layers: the same function, faster."""
        for conv in convs:
            x = F.relu_(F.linear(x, conv.weight.permute(0, 2, 3, 1).flatten(1), conv.bias))
        return x

    def dueling(self, features: Tensor) -> Tensor:
        """Compute the fully connected layers: features [B, F] to Q-values [B, A]."""
        x = F.relu_(self.shared(features))
        advantage = self.advantage(x)
        return self.value(x) + advantage - advantage.mean(-1, keepdim=True)

    def best(self, features: Tensor) -> Tensor:
        """Return the actions with the highest Q-values: features [B, F] to int64 [B].

        The value is the same for all actions, so the advantages decide.
        """
        return self.advantage(F.relu_(self.shared(features))).argmax(-1)

    def _first(self, pixels: Tensor) -> Tensor:
        """Compute conv1 before its ReLU, [B, C, 84, 84] to [B, O, S, S].

        Windows two strides wide are computed by space-to-depth and a 2x2 convolution: the same function,
        faster on a CPU.
        """
        conv, step = self.convs[0], self.geometry[0].stride
        batch, channels, side, _ = pixels.shape
        if self.geometry[0].kernel != 2 * step or side % step:
            return conv(pixels.to(conv.weight.dtype) * (1.0 / 255.0))
        places = side // step
        blocks = pixels.reshape(batch, channels, places, step, places, step)
        blocks = blocks.permute(0, 2, 4, 1, 3, 5).reshape(batch, places, places, channels * step * step)
        blocks = (blocks.to(conv.weight.dtype) * (1.0 / 255.0)).permute(0, 3, 1, 2)
        weight = conv.weight.reshape(-1, channels, 2, step, 2, step)
        weight = weight.permute(0, 2, 4, 1, 3, 5).reshape(-1, 2, 2, channels * step * step)
        return F.conv2d(blocks, weight.permute(0, 3, 1, 2), conv.bias)


class Backend(Protocol):
    """Computes the conv layers. It holds no weights, so networks may share it."""

    def features(self, network: DuelingNetwork, pixels: Tensor) -> Tensor:
        """Compute all conv layers: uint8 [B, C, 84, 84] to float32 [B, F]."""
        ...

    def features_from(self, network: DuelingNetwork, kept: Tensor) -> Tensor:
        """Compute the conv layers after the frozen ones: [B, K] to float32 [B, F]."""
        ...


class Dense:
    """Computes every layer on every pixel, on any device: a pure function of weights and batch.

    Args:
        dtype: of the conv layers; bfloat16 uses autocast, weights and gradients stay float32.
    """

    def __init__(self, dtype: torch.dtype = torch.float32) -> None:
        self.dtype = dtype

    def features(self, network: DuelingNetwork, pixels: Tensor) -> Tensor:
        """Compute all conv layers."""
        with torch.autocast(pixels.device.type, torch.bfloat16, enabled=self.dtype is torch.bfloat16):
            found = network.convolve(pixels)
        # Q-values of actions may differ by less than bfloat16 resolves.
        return found.float()

    def features_from(self, network: DuelingNetwork, kept: Tensor) -> Tensor:
        """Compute the conv layers after the frozen ones."""
        with torch.autocast(kept.device.type, torch.bfloat16, enabled=self.dtype is torch.bfloat16):
            found = network.convolve_from(kept.float())
        return found.float()
