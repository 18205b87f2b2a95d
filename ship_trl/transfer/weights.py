"""Save and load the weights of networks (section 4.1), and permute them for a control."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import torch
from safetensors import SafetensorError, safe_open
from torch import Generator, Tensor

from ship_trl.config.bounds import PICTURE
from ship_trl.config.errors import ConfigError
from ship_trl.config.network import describe_network, geometry, linear_sizes, load_network
from ship_trl.config.schema import read_as
from ship_trl.config.types import Network
from ship_trl.files.disk import atomic_write, write_tensors
from ship_trl.learn.network import DuelingNetwork

Weights = Mapping[str, Tensor]
# Channels of a picture with colours.
COLOURS = 3
# Begins the names of the weights of `DuelingNetwork.reused`.
REUSED = "reused."


def save_weights(
    path: Path, network: DuelingNetwork, about: Mapping[str, object], dtype: torch.dtype = torch.float32
) -> None:
    """Write all weights as safetensors; the header holds `about`, the network's layers and mask as JSON."""
    # Contiguous copies, because safetensors does not support channels-last.
    tensors = {
        key: value.detach().to("cpu", dtype).contiguous() for key, value in network.state_dict().items()
    }
    with atomic_write(path) as draft:
        about = {**about, "network": describe_network(network.config)}
        about |= {"mask": network.mask} if network.mask else {}
        write_tensors(draft, tensors, {"ship_trl": json.dumps(about, sort_keys=True)})


@contextmanager
def open_safetensors(path: Path, key: str) -> Iterator[Any]:
    """Open a safetensors file; `key` is the setting that messages name.

    Raises:
        ConfigError: the file is missing, truncated, or in another format such as pickle.
    """
    if not path.is_file():
        raise ConfigError(f"{key}: no file {path}; allowed: a safetensors file")
    try:
        with safe_open(path, framework="pt") as file:
            yield file
    except (SafetensorError, OSError) as error:
        reason = " ".join(str(error).split())
        raise ConfigError(f"{key}: {path} is not a whole safetensors file ({reason})") from None


class Look(NamedTuple):
    """The layers of the network in a file, and what its pictures need.

    Attributes:
        network: its layers.
        colour: whether its pictures have colours.
        adds_source: whether it adds the Q-values of a second network, `DuelingNetwork.reused`.
        mask: name of the mask under which it was trained, if there was one.
    """

    network: Network
    colour: bool
    adds_source: bool = False
    mask: str | None = None

    @property
    def observes(self) -> str:
        """What the network sees: "vector" or "pixels"."""
        return "vector" if self.network.linear else "pixels"

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of what the network sees: [F] or [C, 84, 84]."""
        picture = (COLOURS if self.colour else 1, PICTURE, PICTURE)
        return (self.network.inputs,) if self.network.linear else picture


def read_look(path: Path, key: str) -> Look:
    """Read what the network in a file is; without a description in the header, its layers are the paper's.

    Raises:
        ConfigError: not a safetensors file, or the header does not describe the file's network.
    """
    with open_safetensors(path, key) as file:
        header = (file.metadata() or {}).get("ship_trl", "{}")
        shapes = {name: file.get_slice(name).get_shape() for name in file.keys()}  # noqa: SIM118
    try:
        about = json.loads(header)
        network: Network = load_network()
        given: Any = str | None
        mask = read_as(given, about.get("mask"), key="mask", from_json=True)
        if "network" in about:
            network = read_as(Network, about["network"], key="network", from_json=True)
            # Check shapes before allocating: a small file must not claim a large network.
            for name, shape in expected_shapes(network, shapes).items():
                if shapes.get(name) != shape:
                    raise ConfigError(f"{name} has another shape")
    except (ValueError, TypeError, AttributeError, RecursionError, ConfigError) as error:
        raise ConfigError(f"{key}: {path}: its header does not describe its network ({error})") from None
    colour = channels(shapes) == COLOURS
    return Look(network, colour, any(name.startswith(REUSED) for name in shapes), mask)


def channels(shapes: Mapping[str, list[int]]) -> int:
    """Return how many channels the pictures of a file's network have; 0 if it has no such weights."""
    return (*shapes.get("conv1.weight", ()), 0, 0)[1]


def expected_shapes(network: Network, shapes: Mapping[str, list[int]]) -> dict[str, list[int]]:
    """Return the shapes of a network's weights below its heads; the file's `shapes` say the channels."""
    layers = geometry(network)  # refuses wrong ones
    if network.linear:
        names = (*(f"linear{n}" for n in range(1, len(network.linear))), "shared")
        sizes = zip(names, linear_sizes(network), strict=True)
        return {f"{name}.weight": [width, below] for name, (below, width) in sizes}
    maps, found = channels(shapes), {}
    for n, layer in enumerate(layers, 1):
        found[f"conv{n}.weight"] = [layer.filters, maps, layer.kernel, layer.kernel]
        maps = layer.filters
    return found | {"shared.weight": [network.hidden, maps]}


def load_weights(
    path: Path, network: DuelingNetwork, key: str = "source_file", free: Collection[str] = ()
) -> Weights:
    """Read weights that fit `network`, as float32.

    Layers in `free` may have other sizes, and then are left out: nothing is copied from them.

    Raises:
        ConfigError: not a safetensors file, its network has other layers, or a weight is not finite.
    """
    look = read_look(path, key)
    # Another network's pictures may have speed vectors or not: its layers fit.
    saved = replace(look.network, vector_time=network.config.vector_time)
    if saved != network.config:
        layers = [describe_network(each).items() for each in (saved, network.config)]
        got, allowed = (" ".join(f"{name}={value}" for name, value in each) for each in layers)
        raise ConfigError(f"{key}: {path} has other layers: {got}; allowed: {allowed}")
    if network.reused is None and look.adds_source:
        raise ConfigError(
            f"{key}: {path} adds the Q-values of its own source (method=q_reuse); "
            "allowed: networks of other methods"
        )
    wanted = {name: tuple(value.shape) for name, value in network.state_dict().items()}
    weights: dict[str, Tensor] = {}
    with open_safetensors(path, key) as file:
        shapes = {name: tuple(file.get_slice(name).get_shape()) for name in file.keys()}  # noqa: SIM118
        # Left out by layer, so that no bias goes without its weight.
        differ = {name.split(".")[0] for name in wanted if wanted[name] != shapes.get(name)} & set(free)
        for name in sorted(wanted.keys() | shapes.keys()):
            if name.split(".")[0] in differ:
                continue
            if shapes.get(name) != wanted.get(name):
                got = f"has shape {shapes[name]}" if name in shapes else "is missing"
                allowed = str(wanted[name]) if name in wanted else "no such tensor"
                raise ConfigError(f"{key}: {path} does not fit the network: {name} {got}, allowed {allowed}")
            weights[name] = file.get_tensor(name)
    for name, value in weights.items():
        if value.dtype not in (torch.float16, torch.float32) or not bool(value.isfinite().all()):
            raise ConfigError(
                f"{key}: {path}: {name} must hold finite torch.float32 or torch.float16 numbers"
            )
    return {name: value.float() for name, value in weights.items()}


def permute_values(weights: Weights, generator: Generator) -> Weights:
    """Shuffle the values within each weight and bias tensor, which keeps their scale but no features.

    Our choice of a control; the paper has none.
    """
    permuted = {}
    for name in sorted(weights):
        value = weights[name]
        order = torch.randperm(value.numel(), generator=generator)
        permuted[name] = value.flatten()[order].reshape(value.shape)
    return permuted
