"""The seam between a study and what it was asked: the engine knows no claim.

A claims file has a function `claims()` that returns `Claims`; `studies/paper/claims.py` is one. A report
without such a file, as in a wheel, has tables and figures, and no verdicts.
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ship_trl.config.errors import ConfigError
from ship_trl.config.imports import import_function
from ship_trl.config.paths import conf_dir

if TYPE_CHECKING:
    from ship_trl.study.study import Study

# The claims of a checkout's own study, below the checkout.
OWN = "studies/paper/claims.py"


@dataclass(frozen=True)
class Verdicts:
    """What a study says of its claims.

    `rows` go to claims.csv, `markdown` to verdicts.md, `lines` to the terminal, `shown` to the page.
    """

    rows: Sequence[Mapping[str, Any]]
    markdown: str
    lines: Sequence[str]
    shown: Mapping[str, Any]


@dataclass(frozen=True)
class Claims:
    """What a study was asked, and how its report shows it.

    `judge` judges a study, given also its folder; `page` is a template that extends the report's. `rules` are
    the files, text first, that said how before the first run. `gains` says by target case and metric how much
    transfer could gain, and a difference within the share `margin` of that counts as none. `titles` are of
    figures, by pair; `similarity` of source and target, by pair, as somebody else measured it.
    """

    judge: Callable[[Study, Path], Verdicts] | None = None
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


def digest(rules: Sequence[Path]) -> str | None:
    """Return the SHA-256 of the files with the rules; None if one is missing."""
    if not all(path.is_file() for path in rules):
        return None
    return hashlib.sha256(b"".join(path.read_bytes() for path in rules)).hexdigest()


def stamp(rules: Sequence[Path]) -> dict[str, Any]:
    """Return digest and commit of the rules and the present time; nothing without rules."""
    now = datetime.now(UTC).isoformat(timespec="seconds")
    return {"digest": digest(rules), "commit": last_commit(rules), "begun": now} if rules else {}


def last_commit(rules: Sequence[Path]) -> str | None:
    """Return commit and time of the last change of the rules; None if unknown or not committed."""

    def git(*words: str) -> str:
        line = ["git", "-C", str(rules[0].parent), *words, "--", *map(str, rules)]
        return subprocess.run(line, capture_output=True, text=True, check=True, timeout=10).stdout.strip()

    try:
        return None if git("status", "--porcelain") else git("log", "-1", "--format=%H of %cI") or None
    except (OSError, subprocess.SubprocessError):
        return None


def describe_rules(begun: Mapping[str, Any], rules: Sequence[Path]) -> str:
    """Say by which rules a study is judged, and whether they have changed since it was begun."""
    if not begun or not rules:
        return "No plan was kept with these runs, so nothing shows that the rules are older than the runs."
    commit = "no commit" if begun["commit"] is None else f"commit {begun['commit']}"
    words = f"Rules: {'/'.join(rules[0].parts[-3:])}, {commit}; the study was begun at {begun['begun']}."
    if digest(rules) != begun["digest"]:
        words += " The text has changed since; that commit has it as it was when the study was begun."
    return words
