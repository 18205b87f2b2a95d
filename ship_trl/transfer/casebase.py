"""The case base: trained networks stored by case or suite, and found by similarity. No torch.

An entry is a folder `<case or suite>/<arm>/seed=<k>-<config hash>/` with `entry.json`, `config.yaml` and
`policy.safetensors`. The first is written last, and without it there is no entry.
"""

from __future__ import annotations

import json
import math
import shutil
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from filelock import FileLock

from ship_trl.config.arm import forms
from ship_trl.config.types import World
from ship_trl.files.disk import atomic_write, read_json
from ship_trl.sim.cases import Case, Suite
from ship_trl.transfer.similarity import MEASURES

POLICY, POLICY_LAST = "policy.safetensors", "policy_last.safetensors"
ENTRY, CONFIG = "entry.json", "config.yaml"
# Folders in the case base for locks and for plans of the planner.
LOCKS, PLANS = ".locks", ".plans"


@dataclass(frozen=True)
class StoredNetwork:
    """A stored network of the suite `case`, mostly one case; `network` are its layers, None the paper's."""

    path: Path
    case: str
    fingerprint: str
    arm: str
    seed: int
    config_hash: str
    scores: dict[str, Any]
    network: dict[str, Any] | None = None

    @property
    def policy(self) -> Path:
        """Path of the weights with the best greedy evaluation."""
        return self.path / POLICY

    @property
    def best_return(self) -> float:
        """Best greedy return; minus infinity if unknown."""
        try:
            return float(self.scores["best"]["return"])
        except (KeyError, TypeError, ValueError, OverflowError):
            return -math.inf


@dataclass(frozen=True)
class Match:
    """A source case, and its value by each of `MEASURES`."""

    case: Case
    measured: dict[str, float]


def read_entry(file: Path) -> StoredNetwork | None:
    """Read the entry of a file; None if there is none or it is not valid."""
    try:
        entry = StoredNetwork(path=file.parent, **read_json(file))
    except (OSError, ValueError, TypeError, AttributeError):
        return None
    texts = (str(entry.path), entry.case, entry.fingerprint, entry.arm, entry.config_hash)
    is_valid = all(type(text) is str and text.isprintable() for text in texts) and type(entry.seed) is int
    return entry if is_valid else None


class CaseBase:
    """The networks stored in a folder, which is created with the first entry."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def entries(self) -> list[StoredNetwork]:
        """Return all valid entries, sorted by path; skip other folders."""
        files = sorted(self.folder.glob(f"*/*/seed=*/{ENTRY}"))
        return [entry for file in files if (entry := read_entry(file)) is not None]

    def representative(self, case: Case) -> StoredNetwork | None:
        """Return the network stored for a case that has the best return, of those with the paper's layers.

        Networks of `q_reuse` are left out: they are refused as a source.
        """
        stored = [e for e in self.entries() if e.fingerprint == case.fingerprint and e.policy.is_file()]
        stored = [e for e in stored if not e.arm.startswith(forms()["q_reuse"].prefix)]
        usable = [e for e in stored if e.network is None and e.best_return > -math.inf]
        return max(usable, key=lambda entry: entry.best_return, default=None)

    def entry_folder(self, suite: Suite, arm: str, seed: int, config_hash: str) -> Path:
        """Return the folder of an entry, which may not exist yet."""
        return self.folder / suite.name / arm / f"seed={seed}-{config_hash}"

    def lock(self, suite: Suite, arm: str, seed: int, config_hash: str) -> FileLock:
        """Return the lock to hold while an entry is made, so that no other process makes the same entry.

        The lock file is never deleted: another process may be waiting for it.
        """
        locks = self.folder / LOCKS
        locks.mkdir(parents=True, exist_ok=True)
        return FileLock(locks / f"{suite.name}-{arm}-{seed}-{config_hash}.lock")

    def find(self, suite: Suite, arm: str, seed: int, config_hash: str) -> StoredNetwork | None:
        """Return the entry of this suite and these settings, or None."""
        entry = read_entry(self.entry_folder(suite, arm, seed, config_hash) / ENTRY)
        if entry is None or entry.fingerprint != suite.fingerprint:
            return None
        # A power cut can leave an empty file.
        return entry if entry.policy.is_file() and entry.policy.stat().st_size > 0 else None

    def retain(
        self,
        suite: Suite,
        arm: str,
        seed: int,
        config_hash: str,
        scores: dict[str, Any],
        run: Path,
        network: dict[str, Any] | None = None,
    ) -> StoredNetwork:
        """Store the network of a finished run; keep an existing entry, because it has the same network."""
        folder = self.entry_folder(suite, arm, seed, config_hash)
        entry = StoredNetwork(folder, suite.name, suite.fingerprint, arm, seed, config_hash, scores, network)
        if self.find(suite, arm, seed, config_hash):
            return entry
        for name in (POLICY, CONFIG):
            with atomic_write(folder / name) as draft:
                shutil.copyfile(run / name, draft)
        values = {key: value for key, value in asdict(entry).items() if key != "path"}
        with atomic_write(folder / ENTRY) as draft:
            draft.write_text(json.dumps(values, indent=1, sort_keys=True))
        return entry


def rank(target: Case, bases: list[Case], world: World, by: str = "similarity") -> list[Match]:
    """Rank source cases by one of `MEASURES`, most similar first; ties keep the order of `bases`."""
    matches = [
        Match(base, {name: measure.value(base, target, world) for name, measure in MEASURES.items()})
        for base in bases
    ]
    sign = 1.0 if MEASURES[by].nearer else -1.0
    return sorted(matches, key=lambda match: sign * match.measured[by])
