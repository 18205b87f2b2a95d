"""Arms: which layers a run copies from its source network, with which weights, which it freezes. No torch.

An arm is one curve of a figure. No other module reads its name.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import total_ordering
from typing import Any

# Values of `layers` that are no number: the whole network, its fully connected layers alone, or all but the
# output layers (value and advantage).
ALL_LAYERS, HEAD, BODY = "all", "head", "body"
DEMONSTRATIONS = "demonstrations"
OUTPUT = ("value", "advantage")
FULLY_CONNECTED = ("shared", *OUTPUT)


class TransferMethodName(StrEnum):
    """How the source is used; `FORMS` says more of each."""

    scratch = "scratch"
    feature_extraction = "feature_extraction"
    finetune = "finetune"
    unfreeze = "unfreeze"
    l2sp = "l2sp"
    guide = "guide"
    qdagger = "qdagger"
    q_reuse = "q_reuse"


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
    """A method, and its arms.

    Attributes:
        prefix: begins their names.
        hooks: `module:class` of what it does, in `ship_trl.transfer.methods`.
        words: what `layers` may be besides a number.
        bare: whether it may be left out, so that nothing is copied.
        uses_function: whether it uses what the source computes, not only its weights.
    """

    prefix: str
    hooks: str = "base:TransferMethod"
    words: tuple[str, ...] = (ALL_LAYERS, HEAD, BODY)
    bare: bool = False
    uses_function: bool = False


# From scratch nothing is copied, and finetuning copies only: both do what every method does.
FORMS = {
    TransferMethodName.scratch: Form("scratch", words=(), bare=True),
    TransferMethodName.feature_extraction: Form("FE", "feature_extraction:FeatureExtraction", (HEAD,)),
    TransferMethodName.finetune: Form("FT"),
    TransferMethodName.unfreeze: Form("GU", "unfreeze:Unfreeze", (ALL_LAYERS,)),
    TransferMethodName.l2sp: Form("SP", "l2sp:L2SP"),
    TransferMethodName.guide: Form("G", "guide:Guide", bare=True, uses_function=True),
    TransferMethodName.qdagger: Form("QD", "qdagger:QDagger", bare=True, uses_function=True),
    TransferMethodName.q_reuse: Form("QR", "q_reuse:QReuse", (), bare=True, uses_function=True),
}
METHODS = {form.prefix: method for method, form in FORMS.items() if method != TransferMethodName.scratch}
LETTERS = {ALL_LAYERS: "W", HEAD: "H", BODY: "B"}
NAME = re.compile(rf"({'|'.join(METHODS)})([1-9]\d*|[WHB])?(?:-(pretrained|random|permuted))?", re.ASCII)


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

    method: TransferMethodName
    layers: int | str | None = None
    weights: SourceWeights = SourceWeights.learned

    def __post_init__(self) -> None:
        form, counted = FORMS[self.method], type(self.layers) is int and self.layers >= 1
        possible = counted or self.layers in form.words or (self.layers is None and form.bare)
        if self.is_scratch:
            possible = self.layers is None and self.weights is SourceWeights.learned
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
        if (found := NAME.fullmatch(name)) is None:
            raise ValueError(f"{name!r:.50} names no arm")
        prefix, layers, weights = found.groups()
        words: dict[str | None, Any] = {letter: word for word, letter in LETTERS.items()} | {None: None}
        count = words[layers] if layers in words else int(layers)
        try:
            return Arm(METHODS[prefix], count, SourceWeights(weights or SourceWeights.learned))
        except ValueError:
            raise ValueError(f"{name!r:.50} names no arm") from None

    @property
    def name(self) -> str:
        """The arm's name in figures, tables and folders."""
        if self.is_scratch:
            return TransferMethodName.scratch.value
        layers = LETTERS.get(str(self.layers), "" if self.layers is None else str(self.layers))
        suffix = "" if self.weights is SourceWeights.learned else f"-{self.weights.value}"
        return f"{FORMS[self.method].prefix}{layers}{suffix}"

    @property
    def is_scratch(self) -> bool:
        """Whether there is no source."""
        return self.method is TransferMethodName.scratch

    @property
    def has_trained_source(self) -> bool:
        """Whether a source network was trained for it."""
        return not self.is_scratch and self.weights is not SourceWeights.random

    @property
    def frozen_layers(self) -> int:
        """How many conv layers, counted from the image, never learn."""
        counted = self.method is TransferMethodName.feature_extraction and self.layers != HEAD
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
        return {"method": self.method.value, "layers": self.layers}

    @property
    def settings(self) -> dict[str, Any]:
        """The values of a configuration that `arm=NAME` stands for."""
        learned = self.weights is SourceWeights.learned
        return self.keys if learned else self.keys | {"source_weights": self.weights.value}

    def label(self, demonstrations: bool) -> str:
        """Return the name of a run of this arm, with a suffix if it begins with demonstrations."""
        return f"{self.name}-{DEMONSTRATIONS}" if demonstrations else self.name

    def __str__(self) -> str:
        return self.name

    def __lt__(self, other: Arm) -> bool:
        return self._order < other._order

    @property
    def _order(self) -> tuple[int, int, int, int]:
        method, weights = list(TransferMethodName).index(self.method), list(SourceWeights).index(self.weights)
        words: list[Any] = [None, HEAD, BODY, ALL_LAYERS]
        count = self.layers if isinstance(self.layers, int) else 0
        return method, weights, 0 if count else words.index(self.layers), count


SCRATCH = Arm(TransferMethodName.scratch)
# What names an arm, for messages and the help.
ARM_NAMES = (
    f"scratch, or {', '.join(METHODS)} with a number of layers or {', '.join(LETTERS.values())}, as FT3; "
    "G, QD and QR alone; with -random, -permuted or -pretrained behind it"
)
