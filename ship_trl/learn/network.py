"""The dueling networks: conv layers on pixels, then fully connected ones (figure 3), or these alone."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any, Protocol

import torch
import torch.nn.functional as F
from torch import Generator, Tensor, nn

from ship_trl.config.network import (
    geometry,
    linear_from,
    linear_sizes,
    load_network,
)
from ship_trl.config.types import BackendName, Learn, Network, Precision, bfloat16_allowed

# Maps states [..., S] to the network's input: uint8 [..., C, 84, 84], or float32 [..., F].
Draw = Callable[[Tensor], Tensor]


class Backend(Protocol):
    """Computes what `DuelingNetwork.encode` does in a number format.

    It holds no weights, so networks may share it.
    """

    name: str
    dtype: torch.dtype

    def features(self, network: DuelingNetwork, observation: Tensor) -> Tensor:
        """Compute all layers of `encode`: uint8 [B, C, 84, 84] or float32 [B, N] to float32 [B, F]."""
        ...

    def features_from(self, network: DuelingNetwork, frozen_features: Tensor) -> Tensor:
        """Compute the conv layers after the frozen ones: [B, K] to float32 [B, F]."""
        ...


# Makes a backend for the CPU that computes only where pictures differ from the background of `Draw`, or only
# for ships that are there; None if it cannot compute the network.
MakeBackend = Callable[["DuelingNetwork", Draw, torch.dtype], Backend | None]


class Dense:
    """Backend for any device that computes every layer on every pixel or place of a ship, without caches.

    Args:
        dtype: of the layers; bfloat16 uses autocast, weights and gradients stay float32.
    """

    name = "dense"

    def __init__(self, dtype: torch.dtype = torch.float32) -> None:
        self.dtype = dtype

    def features(self, network: DuelingNetwork, observation: Tensor) -> Tensor:
        """Compute all layers of `encode`."""
        with torch.autocast(observation.device.type, torch.bfloat16, self.dtype is torch.bfloat16):
            # The next layers compute in float32: Q-values may differ by less than bfloat16 resolves.
            return network.encode(observation).float()

    def features_from(self, network: DuelingNetwork, frozen_features: Tensor) -> Tensor:
        """Compute the conv layers after the frozen ones."""
        with torch.autocast(frozen_features.device.type, torch.bfloat16, self.dtype is torch.bfloat16):
            return network.encode_from(frozen_features.float()).float()


def make_backend(network: DuelingNetwork, draw: Draw, learn: Learn, make: MakeBackend | None) -> Backend:
    """Make the backend that the settings ask for; `auto` means the fastest one that supports the network."""
    device = network.advantage.weight.device
    dtype = choose_dtype(learn.precision, device)
    if learn.backend is BackendName.dense or make is None or device.type != "cpu":
        return Dense(dtype)
    return make(network, draw, dtype) or Dense(dtype)


def choose_dtype(precision: Precision, device: torch.device) -> torch.dtype:
    """Choose the precision of the conv layers, or of the fully connected ones where there are no others.

    `auto` is bfloat16 where the device multiplies it natively, unless `SHIP_TRL_BFLOAT16=off` is set.

    Raises:
        ConfigError: this environment variable is neither `on` nor `off`.
    """
    if not bfloat16_allowed():
        native = False
    elif device.type == "cuda":
        native = torch.cuda.is_bf16_supported(including_emulation=False)
    else:
        capabilities = torch.cpu.get_capabilities()
        native = any(capabilities.get(name) for name in ("avx512_bf16", "amx_bf16"))
    if precision is Precision.bf16 or (precision is Precision.auto and native):
        return torch.bfloat16
    return torch.float32


class DuelingNetwork(nn.Module):
    """Q-values of all actions from pixels: uint8 [B, C, 84, 84] to float32 [B, A].

    Conv layers with ReLU give F features, 200 in the paper's network (section 3.5). The paper describes the
    other layers only as "fully connected layers with a dueling structure". Ours are one shared layer, then
    value (1) and advantage (A).

    Args:
        inputs: channels of the pixels, 1 (grey) or 3 (colour).
        num_actions: A.
        generator: draws the initial weights.
        config: the layers; None for conf/network/paper.yaml.

    Attributes:
        observes: key of the observation that it reads.
        layer_names: names of the layers that can be copied and frozen, `conv1` to the last.
        geometry: windows and maps of the conv layers.
        linear_from: index of the first conv layer whose window is its whole map, 3 in the paper's network.
            From there on, conv layers are linear layers.
        backend: computes the conv layers; replaceable at any time, because all compute the same function.
        frozen: number of layers, counted from the input, that do not learn (see `freeze`).
        mask: name of the mask under which it was trained; None for most.
        reused: a network that does not learn, whose Q-values are added to this one's own; None for most.
            Its weights are saved with the others.
    """

    observes = "pixels"
    frozen = 0
    mask: str | None = None

    def __init__(
        self, inputs: int, num_actions: int, generator: Generator, config: Network | None = None
    ) -> None:
        super().__init__()
        self.config = config or load_network()
        self.geometry = geometry(self.config)
        self.linear_from = linear_from(self.geometry)
        self.layer_names, features, hidden = self._add_layers(inputs)
        self.shared = nn.Linear(features, hidden)
        self.value = nn.Linear(hidden, 1)
        self.advantage = nn.Linear(hidden, num_actions)
        self.backend: Backend = Dense()
        self.reused: DuelingNetwork | None = None
        self.reset(generator)

    def _add_layers(self, inputs: int) -> tuple[tuple[str, ...], int, int]:
        """Add the layers below `shared`; return `layer_names`, F and the width of `shared`."""
        names = tuple(f"conv{n}" for n in range(1, len(self.geometry) + 1))
        for name, layer in zip(names, self.geometry, strict=True):
            conv = nn.Conv2d(inputs, layer.filters, layer.kernel, layer.stride)
            # Channels last throughout: oneDNN then needs no reordering of activations.
            conv.weight.data = conv.weight.data.contiguous(memory_format=torch.channels_last)
            self.add_module(name, conv)
            inputs = layer.filters
        return names, inputs, self.config.hidden

    @property
    def colour(self) -> bool:
        """Whether it sees pictures with colours."""
        return bool(self.config.conv) and self.layers[0].in_channels == 3

    @property
    def all_layers(self) -> list[str]:
        """Names of all layers, also those that no number of layers counts."""
        return [name for name, layer in self.named_children() if layer is not self.reused]

    @property
    def layers(self) -> list[Any]:
        """The layers of `layer_names`, counted from the input."""
        return [getattr(self, name) for name in self.layer_names]

    def freeze(self, layers: int) -> None:
        """Freeze the first `layers` layers, and unfreeze the others.

        Raises:
            ValueError: the network has fewer layers.
        """
        if not 0 <= layers <= len(self.layer_names):
            raise ValueError(f"layers to freeze: allowed: 0 to {len(self.layer_names)}, got {layers}")
        for n, layer in enumerate(self.layers):
            layer.requires_grad_(n >= layers)
        self.frozen = layers

    @torch.no_grad()
    def reset(self, generator: Generator, kept: Collection[str] = ()) -> None:
        """Draw new weights (He et al., 2015) and set biases to zero, in all layers but `kept` and `reused`.

        PyTorch's default weights shrink the signal to a third at each ReLU layer. Training would need a
        hundred episodes to grow it again.
        """
        for name in self.all_layers:
            if name in kept:
                continue
            layer = getattr(self, name)
            assert isinstance(layer, nn.Conv2d | nn.Linear) and layer.bias is not None
            nn.init.kaiming_uniform_(layer.weight, nonlinearity="relu", generator=generator)
            nn.init.zeros_(layer.bias)

    def forward(self, observation: Tensor) -> Tensor:
        """Compute the Q-values of all actions, float32 [..., A].

        Observations are pixels, uint8 [..., C, 84, 84], or features of the frozen layers, [..., K] in half
        precision or float32.
        """
        q = self.own_q_values(observation, self.backend)
        if self.reused is None:
            return q
        with torch.no_grad():
            source_q = self.reused.own_q_values(observation, self.backend)
        return q + source_q

    def own_q_values(self, observation: Tensor, backend: Backend) -> Tensor:
        """Compute the Q-values of `forward` without those of `reused`."""
        are_pixels = observation.dtype is torch.uint8
        compute = backend.features if are_pixels else backend.features_from
        dims = 3 if are_pixels else 1
        if observation.dim() == dims + 1:
            return self.dueling(compute(self, observation))
        shape = observation.shape[:-dims]
        q = self.dueling(compute(self, observation.reshape(-1, *observation.shape[-dims:])))
        return q.reshape(*shape, self.advantage.out_features)

    def dense_q_values(self, observation: Tensor) -> Tensor:
        """Compute the same Q-values without the backend: with gradients for pixels, which may be floats."""
        q = self.dueling(self.encode(observation))
        return q if self.reused is None else q + self.reused.dense_q_values(observation)

    def encode(self, observation: Tensor, layers: int | None = None) -> Tensor:
        """Compute the conv layers, or the first `layers` of them: uint8 [B, C, 84, 84] to [B, F]."""
        convs = self.layers[:layers]
        x = F.relu_(self._conv1(observation))
        for conv in convs[1 : self.linear_from]:
            # Not `conv(x)`: calling three modules takes a tenth of the time of a single frame.
            x = F.relu_(F.conv2d(x, conv.weight, conv.bias, conv.stride))
        # Activations and weights are channels last, so flattening them makes views.
        return self._linear_convs(x.permute(0, 2, 3, 1).flatten(1), convs[self.linear_from :])

    def activations(self, observation: Tensor) -> dict[str, Tensor]:
        """Compute each layer's activations after ReLU: uint8 [B, C, 84, 84] to float32 by layer name.

        Conv layers give [B, filters, side, side], `shared` gives [B, hidden].
        """
        x = F.relu(self._conv1(observation))
        layers = {self.layer_names[0]: x}
        for name, conv in zip(self.layer_names[1:], self.layers[1:], strict=True):
            layers[name] = x = F.relu(conv(x))
        return layers | {"shared": F.relu(self.shared(x.flatten(1)))}

    def encode_from(self, frozen_features: Tensor) -> Tensor:
        """Compute the conv layers after the frozen ones (`linear_from` or more): [B, K] to [B, F]."""
        return self._linear_convs(frozen_features, self.layers[self.frozen :])

    def _linear_convs(self, x: Tensor, convs: list[nn.Conv2d]) -> Tensor:
        """Compute conv layers whose window is their whole map as linear layers, which is faster."""
        for conv in convs:
            x = F.relu_(F.linear(x, conv.weight.permute(0, 2, 3, 1).flatten(1), conv.bias))
        return x

    def dueling(self, features: Tensor) -> Tensor:
        """Compute the fully connected layers: features [..., F] to Q-values [..., A]."""
        return self.q_values(F.relu_(self.shared(features)))

    def q_values(self, hidden: Tensor) -> Tensor:
        """Add value and advantage: activations of `shared` [..., H] to Q-values [..., A]."""
        advantage = self.advantage(hidden)
        return self.value(hidden) + advantage - advantage.mean(-1, keepdim=True)

    def _conv1(self, pixels: Tensor) -> Tensor:
        """Compute conv1 before its ReLU, [B, C, 84, 84] to [B, O, S, S]."""
        conv, stride = self.layers[0], self.geometry[0].stride
        batch, channels, side, _ = pixels.shape
        if self.geometry[0].kernel != 2 * stride or side % stride:
            return conv(pixels.to(conv.weight.dtype) * (1.0 / 255.0))
        # Space-to-depth and a 2x2 convolution: the same result, but faster on a CPU.
        count, depth = side // stride, channels * stride * stride
        blocks = pixels.reshape(batch, channels, count, stride, count, stride)
        blocks = blocks.permute(0, 2, 4, 1, 3, 5).reshape(batch, count, count, depth)
        blocks = (blocks.to(conv.weight.dtype) * (1.0 / 255.0)).permute(0, 3, 1, 2)
        weight = conv.weight.reshape(-1, channels, 2, stride, 2, stride)
        weight = weight.permute(0, 2, 4, 1, 3, 5).reshape(-1, 2, 2, depth)
        return F.conv2d(blocks, weight.permute(0, 3, 1, 2), conv.bias)


class VectorNetwork(DuelingNetwork):
    """Q-values of all actions from numbers: float32 [..., F] to float32 [..., A].

    Fully connected layers with ReLU, `linear1` on; the last one is `shared`, and can be copied as the others.
    The first `per_ship` layers compute each target ship alone, beside own ship's numbers. Then the sums and
    maxima over the ships go on (deep sets; Zaheer et al. 2017), so that what is learned of one ship holds for
    all, in any order and number.

    Otherwise it is a `DuelingNetwork`, whose `inputs` are F. What `encode` computes includes `shared`.
    """

    observes = "vector"

    def _add_layers(self, inputs: int) -> tuple[tuple[str, ...], int, int]:
        """Add the layers below `shared`; return `layer_names`, the inputs of `shared` and its width."""
        sizes = linear_sizes(self.config)
        if not self.config.per_ship:  # then any numbers do
            sizes[0] = inputs, sizes[0][1]
        *sizes, (below, hidden) = sizes
        names = tuple(f"linear{n}" for n in range(1, len(sizes) + 1))
        for name, size in zip(names, sizes, strict=True):
            self.add_module(name, nn.Linear(*size))
        return (*names, "shared"), below, hidden

    def own_q_values(self, observation: Tensor, backend: Backend) -> Tensor:
        """Compute the Q-values of all actions."""
        rows = observation.reshape(-1, observation.shape[-1])
        q = self.q_values(backend.features(self, rows))
        return q.reshape(*observation.shape[:-1], q.shape[-1])

    def dueling(self, features: Tensor) -> Tensor:
        """Compute the streams: features [..., H] to Q-values [..., A]."""
        return self.q_values(features)

    def encode(self, observation: Tensor, layers: int | None = None) -> Tensor:
        """Compute the layers of `layer_names`, or the first `layers` of them: [..., F] to [..., H]."""
        x = self._first_input(observation)
        for n, layer in enumerate(self.layers[:layers], 1):
            x = self._next_input(n, F.relu_(layer(x)), observation)
        return x

    def activations(self, observation: Tensor) -> dict[str, Tensor]:
        """Compute each layer's activations after ReLU, by layer name: [..., W], or [..., K, W] of ships."""
        found: dict[str, Tensor] = {}
        x = self._first_input(observation)
        for n, (name, layer) in enumerate(zip(self.layer_names, self.layers, strict=True), 1):
            found[name] = F.relu(layer(x))
            x = self._next_input(n, found[name], observation)
        return found

    def _first_input(self, observation: Tensor) -> Tensor:
        """Return what the first layer takes: all numbers, or own ship's beside those of each target ship."""
        if not self.config.per_ship:
            return observation
        own, ships = self._split_ships(observation)
        return torch.cat((own[..., None, :].expand(*ships.shape[:-1], own.shape[-1]), ships), -1)

    def _next_input(self, n: int, x: Tensor, observation: Tensor) -> Tensor:
        """Return what the layer after the `n`-th takes, whose activations are `x`."""
        if n != self.config.per_ship:
            return x
        own, ships = self._split_ships(observation)
        # The last number of a ship is 1, and 0 where there is none; activations are never negative.
        x = x * ships[..., -1:].to(x.dtype)
        return torch.cat((own.to(x.dtype), x.sum(-2), x.amax(-2)), -1)

    def _split_ships(self, observation: Tensor) -> tuple[Tensor, Tensor]:
        """Return own ship's numbers [..., O] and those of target ships [..., K, M]."""
        own = self.config.own_numbers
        ships = observation[..., own:].unflatten(-1, (self.config.ships, self.config.ship_numbers))
        return observation[..., :own], ships


def make_network(
    config: Network, num_actions: int, generator: Generator, *, colour: bool = False
) -> DuelingNetwork:
    """Make the network of a configuration: a `VectorNetwork` if it has no conv layers."""
    if config.linear:
        return VectorNetwork(config.inputs, num_actions, generator, config)
    return DuelingNetwork(3 if colour else 1, num_actions, generator, config)
