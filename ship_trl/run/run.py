"""One run: its suites, its source, its folder, the hash of its settings and its random streams. No torch."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

from filelock import FileLock

from ship_trl.config.arm import Arm
from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import stem
from ship_trl.config.types import Config
from ship_trl.policies.demonstrations import Demonstration
from ship_trl.policies.pretrained import Pretrained
from ship_trl.sim.suites import Suite, describe
from ship_trl.transfer.casebase import LOCKS


@dataclass(frozen=True)
class Run:
    """An arm on a target suite with a seed, as `make_run` plans it.

    `source` is the run that trains the source network; None if no source has to be trained. `config_hash` is
    a digest of everything that decides what is learned: the same hash gives the same network on the same
    machine and backend. `demonstrations` fill the replay before training. `source_suite` is what the source
    network learned, if it did and if it can be evaluated without drawing.
    """

    config: Config
    target: Suite
    source: Run | None
    folder: Path
    config_hash: str
    pretrained: Pretrained | None = None
    demonstrations: tuple[Demonstration, ...] = ()
    source_suite: Suite | None = None

    @property
    def arm(self) -> Arm:
        """Arm of the run."""
        return self.config.arm

    @property
    def title(self) -> str:
        """Title of the run for people, in one line."""
        config = self.config
        start = "" if self.arm.is_scratch else f"{describe(str(config.source))} -> "
        return f"{start}{describe(str(config.target))}, {config.arm_label}, seed {config.seed}"

    @property
    def evaluation_episodes(self) -> int:
        """Number of episodes of a greedy evaluation: each case once, or the episodes asked for if drawn."""
        asked = self.config.learn.evaluate_episodes if self.target.is_drawn else 1
        return self.target.whole_rounds(asked)

    @property
    def entry_arm(self) -> str:
        """Name of its network in the case base: the arm and, after a transfer, the source case."""
        label = self.config.arm_label
        return label if self.arm.is_scratch else f"{label}-from-{stem(str(self.config.source))}"

    def stream(self, purpose: str) -> int:
        """Return the seed of the random stream for one purpose.

        It depends on source and target. Otherwise the new layers of a transfer would get the initial weights
        of its source, which were trained together with the copied layers.
        """
        # The stem, so that a bundled case by name and by path gets the same streams.
        source = "" if self.arm.is_scratch else self.config.source and stem(self.config.source)
        words = (self.config.seed, source, self.target.fingerprint, purpose)
        return int.from_bytes(hashlib.sha256(json.dumps(words).encode()).digest()[:8], "big") >> 1

    def lock(self) -> FileLock:
        """Return the lock to hold while the run's folder is written; its file is never deleted."""
        locks = Path(self.config.output) / LOCKS
        try:
            locks.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ConfigError(f"output: cannot create {locks}: {error.strerror}") from None
        config = self.config
        return FileLock(locks / f"{config.label}-{config.arm_label}-{config.seed}.lock")
