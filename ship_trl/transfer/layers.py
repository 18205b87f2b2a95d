"""Copying layers from a source network and freezing them (sections 3.5 and 4.1)."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from torch import Generator, Tensor, nn

from ship_trl.config import ConfigError
from ship_trl.learn.network import CONV_NAMES
from ship_trl.paths import replacing

Weights = Mapping[str, Tensor]


@dataclasses.dataclass(frozen=True)
class Transfer:
    """What is taken from a source network: its weights, how many layers, and whether they freeze."""

    weights: Weights
    layers: int | str
    frozen: bool


def copied_layers(layers: int | str) -> tuple[str, ...]:
    """Names of the first n conv layers, counted from the image, or of every layer for `all`."""
    return () if layers == "all" else CONV_NAMES[: int(layers)]


def apply(network: nn.Module, transfer: Transfer) -> None:
    """Copy the transfer's layers into `network`, and freeze them if it says so."""
    names = copied_layers(transfer.layers)
    for key, parameter in network.named_parameters():
        if transfer.layers == "all" or key.split(".")[0] in names:
            parameter.data.copy_(transfer.weights[key])
            parameter.requires_grad_(not transfer.frozen)


def permuted(weights: Weights, generator: Generator) -> Weights:
    """Shuffle the numbers of each weight tensor and of each bias: the same scale, but no features."""
    found = {}
    for name in sorted(weights):
        value = weights[name]
        order = torch.randperm(value.numel(), generator=generator)
        found[name] = value.flatten()[order].reshape(value.shape)
    return found


def save_weights(path: Path, network: nn.Module, about: Mapping[str, object]) -> None:
    """Write all weights as safetensors, with `about` (JSON) in the header."""
    from safetensors.torch import save_file

    # Contiguous copies: safetensors knows no channels-last.
    tensors = {key: value.detach().cpu().contiguous() for key, value in network.state_dict().items()}
    with replacing(path) as draft:
        save_file(tensors, draft, metadata={"ship_trl": json.dumps(dict(about), sort_keys=True)})


def load_weights(path: Path, network: nn.Module, key: str = "source_file") -> Weights:
    """Read weights for a network of `network`'s architecture; nothing is unpickled.

    Raises:
        ConfigError: no such file, not safetensors (a pickle, or cut short), another architecture,
            or weights that are not finite.
    """
    if not path.is_file():
        raise ConfigError(f"{key}: no file {path}; a safetensors file is allowed")
    wanted = network.state_dict()
    try:
        with safe_open(path, framework="pt") as file:
            names = set(file.keys())
            shapes = {name: tuple(file.get_slice(name).get_shape()) for name in names}
            problem = _mismatch(shapes, {name: tuple(value.shape) for name, value in wanted.items()})
            if problem:
                raise ConfigError(f"{key}: {path} is of another architecture: {problem}")
            weights = {name: file.get_tensor(name) for name in sorted(names)}
    except (SafetensorError, OSError) as error:
        reason = " ".join(str(error).split())
        raise ConfigError(f"{key}: {path} is not a whole safetensors file ({reason})") from None
    for name, value in weights.items():
        if value.dtype != wanted[name].dtype or not bool(value.isfinite().all()):
            raise ConfigError(f"{key}: {path}: {name} must hold finite {wanted[name].dtype} numbers")
    return weights


def _mismatch(got: Mapping[str, tuple[int, ...]], wanted: Mapping[str, tuple[int, ...]]) -> str:
    for name in sorted(wanted.keys() | got.keys()):
        if name not in got:
            return f"{name} is missing"
        if name not in wanted:
            return f"{name} is not part of the network"
        if got[name] != wanted[name]:
            return f"{name} has shape {got[name]}, allowed {wanted[name]}"
    return ""
