"""The network's layers: read from conf/network, and the sizes of their maps. No torch."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, NamedTuple

from omegaconf import OmegaConf

from ship_trl.config.bounds import PICTURE
from ship_trl.config.errors import require
from ship_trl.config.paths import conf_dir
from ship_trl.config.schema import read_as
from ship_trl.config.types import Network, plain

# Pixels that the incremental backend compares at once.
WORD = 4
# Keys of a network with conv layers; all others are of one with `linear` layers.
CONV_KEYS = "conv", "hidden", "vector_time"


class ConvLayer(NamedTuple):
    """A conv layer without padding: windows of side `kernel`, `stride` apart, on a map of side `below`."""

    filters: int
    kernel: int
    stride: int
    below: int

    @property
    def side(self) -> int:
        """Side of its output map."""
        return (self.below - self.kernel) // self.stride + 1

    @property
    def whole(self) -> bool:
        """Whether its window is the whole map: then it is a linear layer."""
        return self.kernel == self.below


Geometry = tuple[ConvLayer, ...]


def load_network(name: str = "paper") -> Network:
    """Read a network of conf/network, for use without Hydra."""
    return read_as(Network, OmegaConf.load(conf_dir() / "network" / f"{name}.yaml"))


def vector_part(part: Network, whole: Network) -> list[int]:
    """Return where the numbers that a network sees stand among the numbers of a network that sees more.

    So networks that see fewer ships, or no encounters, act on the numbers of Gymnasium's environment.
    """
    each = [*range(part.ship_numbers - 1), whole.ship_numbers - 1]
    first = range(whole.own_numbers, whole.own_numbers + part.ships * whole.ship_numbers, whole.ship_numbers)
    return [*range(part.own_numbers), *(start + number for start in first for number in each)]


def geometry(network: Network) -> Geometry:
    """Compute the input and output maps of the conv layers, from the picture on; a vector has none.

    Raises:
        ConfigError: a kernel is larger than its map, or the last one does not cover its map; or no network
            has these keys: conv layers and a hidden one, or linear layers alone.
    """
    given, own = "without network.linear", ["conv", "hidden"]
    others = [one.name for one in fields(Network) if one.name not in (*CONV_KEYS, "linear")]
    if network.linear:
        given, own, others = "with network.linear", ["ships"], list(CONV_KEYS)
        allowed = f"less than the {len(network.linear)} layers of network.linear"
        require(network.per_ship < len(network.linear), "network.per_ship", allowed, network.per_ship)
    for key in (*own, *others):
        allowed, got = "given" if key in own else "left out", getattr(network, key)
        require(bool(got) == (key in own), f"network.{key}", f"{allowed} {given}", got)
    layers: list[ConvLayer] = []
    side = PICTURE
    for n, (filters, kernel, stride) in enumerate(network.conv):
        layer = ConvLayer(filters, kernel, stride, side)
        is_last = n == len(network.conv) - 1
        if kernel > side or (is_last and not layer.whole):
            allowed = f"{side}, to cover the last map" if is_last else f"at most {side}, the side of its map"
            require(False, f"network.conv[{n}][1]", allowed, kernel)
        layers.append(layer)
        side = layer.side
    return tuple(layers)


def linear_sizes(network: Network) -> list[tuple[int, int]]:
    """Return how many numbers each fully connected layer takes and gives.

    A layer for one ship takes own ship's numbers and this ship's. The first layer after those takes sums and
    maxima over the ships, and own ship's numbers again.
    """
    below = network.own_numbers + network.ship_numbers if network.per_ship else network.inputs
    sizes = []
    for n, width in enumerate(network.linear, 1):
        sizes.append((below, width))
        below = network.own_numbers + 2 * width if n == network.per_ship else width
    return sizes


def count_numbers(network: Network, channels: int) -> tuple[int, int]:
    """Return the number of weights, and an upper bound of the numbers in all maps of one observation."""
    if network.linear:
        weights = sum(below * width for below, width in linear_sizes(network))
        return weights, network.inputs + network.ships * sum(network.linear)
    weights, maps, below = 0, channels * PICTURE**2, channels
    for layer in geometry(network):
        weights += below * layer.filters * layer.kernel**2
        maps, below = maps + layer.filters * layer.side**2, layer.filters
    return weights + below * network.hidden, maps


def linear_from(layers: Geometry) -> int:
    """Return the index of the first linear layer after the first layer: 3 in the paper's network."""
    return next((n for n, layer in enumerate(layers) if n > 0 and layer.whole), len(layers))


def describe_network(network: Network) -> dict[str, Any]:
    """Return a network as plain values, without the keys that its kind does not have."""
    return {key: value for key, value in plain(network).items() if value}


def non_default_network(network: Network) -> dict[str, Any] | None:
    """Return a network as plain values, and None for the paper's, which files do not name."""
    values = describe_network(network)
    return None if values == describe_network(load_network()) else values


def supports_incremental(layers: Geometry) -> bool:
    """Return whether `learn.backend=incremental` can compute these layers: it compares words of pixels."""
    return len(layers) > 1 and layers[0].kernel % WORD == 0 and layers[0].stride % WORD == 0
