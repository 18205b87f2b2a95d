"""The network's layers: read from conf/network, checked, and what follows from them. No torch."""

from __future__ import annotations

from typing import Any, NamedTuple

from omegaconf import OmegaConf

from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import conf_dir
from ship_trl.config.types import PICTURE, Network, plain

# Filters of a layer and hidden units, at most: more would not fit into memory.
MOST_UNITS = 4096
# Pixels that are compared at once where only what differs from a background is computed.
WORD = 4


class ConvLayer(NamedTuple):
    """A conv layer without padding: windows of side `kernel`, `stride` apart, on a map of side `below`."""

    filters: int
    kernel: int
    stride: int
    below: int

    @property
    def side(self) -> int:
        """Side of the map that it gives."""
        return (self.below - self.kernel) // self.stride + 1

    @property
    def whole(self) -> bool:
        """Whether its one window is the whole map, so that it is a linear layer."""
        return self.kernel == self.below


Geometry = tuple[ConvLayer, ...]


def load_network(name: str = "paper") -> Network:
    """Read a network of conf/network, for use without Hydra."""
    values = OmegaConf.merge(
        OmegaConf.structured(Network), OmegaConf.load(conf_dir() / "network" / f"{name}.yaml")
    )
    network: Any = OmegaConf.to_object(values)
    return network


def geometry(network: Network) -> Geometry:
    """Find the maps that the conv layers read and give, from the picture on.

    Raises:
        ConfigError: there are no layers, one is not three positive numbers or larger than its map, the last
            one does not cover its map, or there are no hidden units.
    """
    if not network.conv:
        raise ConfigError("network.conv: must be at least one [filters, kernel, stride], got []")
    if not 1 <= network.hidden <= MOST_UNITS:
        raise ConfigError(f"network.hidden: must be 1 to {MOST_UNITS}, got {network.hidden}")
    layers: list[ConvLayer] = []
    side = PICTURE
    for n, numbers in enumerate(network.conv):
        key = f"network.conv[{n}]"
        if len(numbers) != 3 or min(numbers) < 1:
            raise ConfigError(f"{key}: must be [filters, kernel, stride], each at least 1, got {numbers}")
        filters, kernel, stride = numbers
        if filters > MOST_UNITS:
            raise ConfigError(f"{key}: at most {MOST_UNITS} filters are allowed, got {filters}")
        layer = ConvLayer(filters, kernel, stride, side)
        last = n == len(network.conv) - 1
        if kernel > side or (last and not layer.whole):
            allowed = f"{side}, to cover the last map" if last else f"at most {side}, the side of its map"
            raise ConfigError(f"{key}: the kernel must be {allowed}, got {kernel}")
        layers.append(layer)
        side = layer.side
    return tuple(layers)


def linear_from(layers: Geometry) -> int:
    """Count the layers before the first one, besides that of the picture, that is a linear layer: paper 3."""
    return next((n for n, layer in enumerate(layers) if n > 0 and layer.whole), len(layers))


def others(network: Network) -> dict[str, Any] | None:
    """Give a network that is not the paper's as plain values, and None for the paper's.

    The paper's was the only one before there were others: what was written down then says nothing of it.
    """
    return None if plain(network) == plain(load_network()) else plain(network)


def cut_by_words(layers: Geometry) -> bool:
    """Whether `learn.backend=incremental` serves these layers: it compares pixels a word at a time."""
    first = layers[0]
    return len(layers) > 1 and first.kernel % WORD == 0 and first.stride % WORD == 0
