"""Arms: which layers a run copies from its source network, with which weights, which it freezes. No torch.

An arm is one curve of a figure. No other module reads its name.
"""

from __future__ import annotations

import dataclasses
import re
from dataclasses import dataclass
from enum import StrEnum
from functools import total_ordering
from typing import Any

# The value of `layers` that copies the whole network, its fully connected layers too.
ALL_LAYERS = "all"
DEMONSTRATIONS = "demonstrations"


class Method(StrEnum):
    """How the source's layers are used (section 3.5)."""

    scratch = "scratch"
    feature_extraction = "feature_extraction"
    finetune = "finetune"


class SourceWeights(StrEnum):
    """Which weights are copied: what the source learned or, in a control, weights without features.

    `pretrained` is what the bundled network of the source case learned.
    """

    learned = "learned"
    pretrained = "pretrained"
    random = "random"
    permuted = "permuted"


PREFIXES = {Method.feature_extraction: "FE", Method.finetune: "FT"}
METHODS = {prefix: method for method, prefix in PREFIXES.items()}
# Only finetuning copies the whole network.
NAME = re.compile(r"(FE(?!W)|FT)([1-9]\d*|W)(?:-(pretrained|random|permuted))?", re.ASCII)


@total_ordering
@dataclass(frozen=True)
class Arm:
    """A method, the layers that it copies, and the weights that they get.

    Arms sort as figures list them: by method, then learned weights before controls, then by layers.

    Args:
        method: scratch copies nothing, feature extraction freezes what it copies, finetuning trains it.
        layers: how many conv layers are copied, counted from the image; `all` is the whole network, which
            only finetuning allows; None from scratch.
        weights: what the source's layers hold.

    Raises:
        ValueError: there is no such arm.
    """

    method: Method
    layers: int | str | None = None
    weights: SourceWeights = SourceWeights.learned

    def __post_init__(self) -> None:
        counted = type(self.layers) is int and self.layers >= 1
        possible = {
            Method.scratch: self.layers is None and self.weights is SourceWeights.learned,
            Method.feature_extraction: counted,
            Method.finetune: counted or self.layers == ALL_LAYERS,
        }
        if not possible[self.method]:
            raise ValueError(f"no arm has {self.method}, layers {self.layers}, {self.weights} weights")

    @classmethod
    def parse(cls, name: str) -> Arm:
        """Read an arm's name, such as `scratch`, `FT3`, `FTW` or `FE3-random`.

        Raises:
            ValueError: there is no arm of this name.
        """
        if name == SCRATCH.name:
            return SCRATCH
        if (found := NAME.fullmatch(name)) is None:
            raise ValueError(f"{name!r:.50} names no arm")
        prefix, layers, weights = found.groups()
        count = ALL_LAYERS if layers == "W" else int(layers)
        return Arm(METHODS[prefix], count, SourceWeights(weights or SourceWeights.learned))

    @property
    def name(self) -> str:
        """The arm's name in figures, tables and folders."""
        if self.is_scratch:
            return Method.scratch.value
        layers = "W" if self.copies_all else str(self.layers)
        suffix = "" if self.weights is SourceWeights.learned else f"-{self.weights.value}"
        return f"{PREFIXES[self.method]}{layers}{suffix}"

    @property
    def is_scratch(self) -> bool:
        """Whether nothing is copied."""
        return self.method is Method.scratch

    @property
    def copies_all(self) -> bool:
        """Whether the whole network is copied."""
        return self.layers == ALL_LAYERS

    @property
    def has_trained_source(self) -> bool:
        """Whether a source network was trained for it."""
        return not self.is_scratch and self.weights is not SourceWeights.random

    @property
    def frozen_layers(self) -> int:
        """How many conv layers, counted from the image, never learn."""
        return int(self.layers or 0) if self.method is Method.feature_extraction else 0

    def copied_layers(self, conv_layers: int) -> int:
        """Count the copied conv layers of a network that has `conv_layers` of them."""
        return conv_layers if self.copies_all else int(self.layers or 0)

    @property
    def keys(self) -> dict[str, Any]:
        """Its method and layers, as results and hashes hold them and a command line sets them."""
        return {"method": self.method.value, "layers": self.layers}

    def with_weights(self, weights: SourceWeights) -> Arm:
        """Return the same arm with other weights, such as its control."""
        return dataclasses.replace(self, weights=weights)

    def label(self, demonstrations: bool) -> str:
        """Return the name of a run of this arm, with a suffix if it begins with demonstrations."""
        return f"{self.name}-{DEMONSTRATIONS}" if demonstrations else self.name

    def __str__(self) -> str:
        return self.name

    def __lt__(self, other: Arm) -> bool:
        return self._order < other._order

    @property
    def _order(self) -> tuple[int, int, bool, int]:
        method, weights = list(Method).index(self.method), list(SourceWeights).index(self.weights)
        return method, weights, self.copies_all, self.copied_layers(0)


SCRATCH = Arm(Method.scratch)
