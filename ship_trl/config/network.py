"""The network's layers: read from conf/network, and the sizes of their maps. No torch."""

from __future__ import annotations

from typing import Any, NamedTuple

from omegaconf import OmegaConf

from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import conf_dir
from ship_trl.config.schema import read_as
from ship_trl.config.types import PICTURE, Network, plain

# Pixels that the incremental backend compares at once.
WORD = 4


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


def geometry(network: Network) -> Geometry:
    """Compute the input and output maps of the conv layers, from the picture on.

    Raises:
        ConfigError: a kernel is larger than its map, or the last one does not cover its map.
    """
    layers: list[ConvLayer] = []
    side = PICTURE
    for n, (filters, kernel, stride) in enumerate(network.conv):
        layer = ConvLayer(filters, kernel, stride, side)
        is_last = n == len(network.conv) - 1
        if kernel > side or (is_last and not layer.whole):
            allowed = f"{side}, to cover the last map" if is_last else f"at most {side}, the side of its map"
            raise ConfigError(f"network.conv[{n}]: the kernel must be {allowed}, got {kernel}")
        layers.append(layer)
        side = layer.side
    return tuple(layers)


def linear_from(layers: Geometry) -> int:
    """Return the index of the first linear layer after the first layer: 3 in the paper's network."""
    return next((n for n, layer in enumerate(layers) if n > 0 and layer.whole), len(layers))


def non_default_network(network: Network) -> dict[str, Any] | None:
    """Return a network as plain values, and None for the paper's, which files do not name."""
    return None if plain(network) == plain(load_network()) else plain(network)


def supports_incremental(layers: Geometry) -> bool:
    """Return whether `learn.backend=incremental` can compute these layers: it compares words of pixels."""
    first = layers[0]
    return len(layers) > 1 and first.kernel % WORD == 0 and first.stride % WORD == 0
