"""Arms: which layers a run copies from its source network, with which weights, which it freezes. No torch.

An arm is one curve of a figure. No other module reads its name.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cache, total_ordering
from importlib import import_module
from typing import Annotated, Any

from ship_trl.config.paths import module_names
from ship_trl.config.schema import rule

# Values of `layers` that are no number: the whole network, its fully connected layers alone, or all but the
# output layers (value and advantage).
ALL_LAYERS, HEAD, BODY = "all", "head", "body"
LETTERS = {ALL_LAYERS: "W", HEAD: "H", BODY: "B"}
OUTPUT = ("value", "advantage")
FULLY_CONNECTED = ("shared", *OUTPUT)
# How the source is used, a file each. Figures list these methods first, then others by their names.
FIRST = ["feature_extraction", "finetune", "unfreeze", "l2sp", "guide", "qdagger", "q_reuse"]
FILES = {*module_names("transfer/methods")} - {"base"}
METHODS = ["scratch", *FIRST, *sorted(FILES.difference(FIRST))]
MethodName = Annotated[str, rule(f"one of {', '.join(METHODS)}", METHODS.__contains__)]
NAME = re.compile(r"([A-Z]+?)([1-9]\d*|[WHB])?(?:-(pretrained|random|permuted))?", re.ASCII)
# Ends the arm's name of a run that begins with demonstrations.
DEMONSTRATED = "-demonstrations"


class SourceWeights(StrEnum):
    """Which weights are copied: what the source learned or, in a control, weights without features.

    `pretrained` is what the bundled network of the source case learned.
    """

    learned = "learned"
    pretrained = "pretrained"
    random = "random"
    permuted = "permuted"


@dataclass(frozen=True)
class Form:
    """How the arms of a method are written, and what it needs; each file of `transfer/methods` has one.

    Attributes:
        prefix: begins their names, in capital letters.
        words: what `layers` may be besides a number.
        bare: whether it may be left out, so that nothing is copied.
        uses_function: whether it uses what the source computes, not only its weights.
        settings: the dataclass of its keys below `transfer`.
    """

    prefix: str
    words: tuple[str, ...] = (ALL_LAYERS, HEAD, BODY)
    bare: bool = False
    uses_function: bool = False
    settings: type | None = None


@cache
def forms() -> dict[str, Form]:
    """Return the form of each method, as its file says it."""
    return {name: import_module(f"ship_trl.transfer.methods.{name}").FORM for name in METHODS[1:]}


@total_ordering
@dataclass(frozen=True)
class Arm:
    """A method, the layers that it copies, and the weights that they get.

    Arms sort as figures list them: by method, then learned weights before controls, then by layers.

    Args:
        method: scratch copies nothing, feature extraction freezes what it copies, finetuning trains it.
        layers: how many conv layers are copied, counted from the image; or `all`, `head` or `body`; None if
            nothing is copied.
        weights: what the source's layers hold.

    Raises:
        ValueError: there is no such arm.
    """

    method: str
    layers: int | str | None = None
    weights: SourceWeights = SourceWeights.learned

    def __post_init__(self) -> None:
        if self.is_scratch:
            possible = self.layers is None and self.weights is SourceWeights.learned
        else:
            form, counted = forms()[self.method], type(self.layers) is int and self.layers >= 1
            possible = counted or self.layers in form.words or (self.layers is None and form.bare)
        if not possible:
            raise ValueError(f"no arm has {self.method}, layers {self.layers}, {self.weights} weights")

    @classmethod
    def parse(cls, name: str) -> Arm:
        """Read an arm's name, such as `scratch`, `FT3`, `FTW` or `FE3-random`.

        Raises:
            ValueError: there is no arm of this name.
        """
        if name == SCRATCH.name:
            return SCRATCH
        try:
            prefix, layers, weights = found.groups() if (found := NAME.fullmatch(name)) else ("", "", "")
            method = next(one for one, form in forms().items() if form.prefix == prefix)
            words: dict[str | None, Any] = {letter: word for word, letter in LETTERS.items()} | {None: None}
            count = words[layers] if layers in words else int(layers)
            return Arm(method, count, SourceWeights(weights or SourceWeights.learned))
        except (ValueError, StopIteration):
            raise ValueError(f"{name!r:.50} names no arm") from None

    @classmethod
    def of_run(cls, name: str) -> Arm:
        """Read the arm of a run, whether it begins with demonstrations or not.

        Raises:
            ValueError: there is no arm of this name.
        """
        return cls.parse(name.removesuffix(DEMONSTRATED))

    @property
    def name(self) -> str:
        """The arm's name in figures, tables and folders."""
        if self.is_scratch:
            return self.method
        layers = LETTERS.get(str(self.layers), str(self.layers or ""))
        suffix = "" if self.weights is SourceWeights.learned else f"-{self.weights}"
        return f"{forms()[self.method].prefix}{layers}{suffix}"

    @property
    def is_scratch(self) -> bool:
        """Whether there is no source."""
        return self.method == "scratch"

    @property
    def has_trained_source(self) -> bool:
        """Whether a source network was trained for it."""
        return not self.is_scratch and self.weights is not SourceWeights.random

    @property
    def frozen_layers(self) -> int:
        """How many conv layers, counted from the image, never learn."""
        counted = self.method == "feature_extraction" and self.layers != HEAD
        return int(self.layers or 0) if counted else 0

    def copied(self, layers: Sequence[str], counted: Sequence[str]) -> tuple[str, ...]:
        """Return which of a network's layers are copied; `counted` are those that a number counts."""
        if type(self.layers) is int:
            return tuple(name for name in layers if name in counted[: self.layers])
        if self.layers == HEAD:
            return tuple(name for name in layers if name in FULLY_CONNECTED)
        if self.layers == BODY:
            return tuple(name for name in layers if name not in OUTPUT)
        return tuple(layers) if self.layers == ALL_LAYERS else ()

    @property
    def keys(self) -> dict[str, Any]:
        """Its method and layers, as results and hashes hold them and a command line sets them."""
        return {"method": self.method, "layers": self.layers}

    @property
    def settings(self) -> dict[str, Any]:
        """The values of a configuration that `arm=NAME` stands for."""
        learned = self.weights is SourceWeights.learned
        return self.keys if learned else self.keys | {"source_weights": self.weights.value}

    def __str__(self) -> str:
        return self.name

    def __lt__(self, other: Arm) -> bool:
        return self._order < other._order

    @property
    def _order(self) -> tuple[int, int, int, int]:
        words: list[Any] = [None, HEAD, BODY, ALL_LAYERS]
        count = self.layers if isinstance(self.layers, int) else 0
        place = 0 if count else words.index(self.layers)
        return METHODS.index(self.method), list(SourceWeights).index(self.weights), place, count


SCRATCH = Arm("scratch")


def arm_names() -> str:
    """Return what names an arm, for messages."""
    prefixes = ", ".join(form.prefix for form in forms().values())
    alone = ", ".join(form.prefix for form in forms().values() if form.bare)
    return (
        f"scratch, or {prefixes} with a number of layers or {', '.join(LETTERS.values())}, as FT3; "
        f"{alone} alone; with -random, -permuted or -pretrained behind it"
    )
