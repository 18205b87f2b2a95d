"""The seam between a study and what it was asked: the engine knows no claim.

A claims file has a function `claims()` that returns `Claims`; `studies/paper/claims.py` is one. A study has
them if it is begun with the pairs that they are about. Without them, as in a wheel, a report has no verdicts.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ship_trl.config.errors import ConfigError
from ship_trl.config.imports import import_function
from ship_trl.config.paths import conf_dir

# The claims of a checkout's own study, below the checkout.
OWN = "studies/paper/claims.py"


@dataclass(frozen=True)
class Verdicts:
    """What a study says of its claims.

    `rows` go to claims.csv, `lines` to the terminal, `shown` to the page.
    """

    rows: Sequence[Mapping[str, Any]]
    lines: Sequence[str]
    shown: Mapping[str, Any]


@dataclass(frozen=True)
class Claims:
    """What a study with certain `pairs` is asked, and how its report shows it.

    `judge` judges a `Study` in a folder; `page` is a template that extends the report's. `rules` are the
    files, text first, that said how before the first run. `gains` says by target case and metric how much
    transfer could gain, and a difference within the share `margin` of that counts as none. `titles` are of
    figures, by pair; `similarity` of source and target, by pair, as somebody else measured it.
    """

    judge: Callable[[Any, Path], Verdicts] | None = None
    pairs: tuple[str, ...] = ()
    page: Path | None = None
    rules: tuple[Path, ...] = ()
    margin: float | None = None
    gains: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    titles: Mapping[str, str] = field(default_factory=dict)
    similarity: Mapping[str, float] = field(default_factory=dict)

    def possible_gain(self, target: str, metric: str) -> float | None:
        """Return how much transfer could gain in a metric on a target case; None if it was not measured."""
        return self.gains.get(target, {}).get(metric)

    def title(self, name: str, words: str) -> str:
        """Return the title of a figure of a pair, or of the new case."""
        return f"{self.titles[name]}: {words}" if name in self.titles else words[0].upper() + words[1:]


NO_CLAIMS = Claims()


def load_claims(path: Path | None = None) -> Claims:
    """Load a claims file; without a path the checkout's own, or none where the package is not a checkout.

    Raises:
        ConfigError: the file cannot be used.
    """
    root = conf_dir().parent
    if path is None and not (root / OWN).is_file():
        return NO_CLAIMS
    # What lies beside a claims file is imported by its name in the checkout.
    if str(root) not in sys.path:
        sys.path.append(str(root))
    found = import_function(f"{path or root / OWN}:claims", "--claims")()
    if not isinstance(found, Claims):
        raise ConfigError(f"--claims: {path}: claims() must return ship_trl.study.claims.Claims")
    return found
