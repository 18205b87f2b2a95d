"""The network's layers: read from conf/network, and the sizes of their maps. No torch."""

from __future__ import annotations

from typing import Any, NamedTuple

from omegaconf import OmegaConf

from ship_trl.config.bounds import MAX_UNITS, OWN_NUMBERS, PICTURE, SHIP_NUMBERS
from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import conf_dir
from ship_trl.config.schema import read_as
from ship_trl.config.types import Network, plain

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


def check_layers(network: Network) -> None:
    """Check that a network has conv layers and a hidden one, or linear layers alone.

    Raises:
        ConfigError: it has not.
    """
    if network.linear:
        for key in ("conv", "hidden", "vector_time"):
            if got := getattr(network, key):
                raise ConfigError(f"network.{key}: must be left out beside network.linear, got {got}")
        if not network.ships:
            raise ConfigError("network.ships: must be at least 1 with network.linear, got 0")
        if network.per_ship >= len(network.linear):
            allowed = f"less than the {len(network.linear)} layers of network.linear"
            raise ConfigError(f"network.per_ship: must be {allowed}, got {network.per_ship}")
    elif not network.conv:
        raise ConfigError("network.conv: must be at least one [filters, kernel, stride], got []")
    elif not network.hidden:
        raise ConfigError(f"network.hidden: must be from 1 to {MAX_UNITS}, got 0")
    elif network.ships or network.per_ship:
        key, got = ("ships", network.ships) if network.ships else ("per_ship", network.per_ship)
        raise ConfigError(f"network.{key}: must be left out without network.linear, got {got}")


def geometry(network: Network) -> Geometry:
    """Compute the input and output maps of the conv layers, from the picture on; a vector has none.

    Raises:
        ConfigError: a kernel is larger than its map, or the last one does not cover its map; or no network
            has these keys.
    """
    check_layers(network)
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


def linear_sizes(network: Network) -> list[tuple[int, int]]:
    """Return how many numbers each fully connected layer takes and gives.

    A layer for one ship takes own ship's numbers and this ship's. The first layer after those takes sums and
    maxima over the ships, and own ship's numbers again.
    """
    below = OWN_NUMBERS + SHIP_NUMBERS if network.per_ship else network.inputs
    sizes = []
    for n, width in enumerate(network.linear, 1):
        sizes.append((below, width))
        below = OWN_NUMBERS + 2 * width if n == network.per_ship else width
    return sizes


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
