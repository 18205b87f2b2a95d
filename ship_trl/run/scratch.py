"""Find the runs from scratch that a transfer is compared with. No torch."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ship_trl.config.arm import SCRATCH
from ship_trl.files.curve import CurveError, read_curve, split
from ship_trl.files.result import ResultError, read_result
from ship_trl.policies import pretrained
from ship_trl.run.plan import hash_of
from ship_trl.run.run import Run


def scratch_returns(run: Run) -> NDArray[np.float64] | None:
    """Return raw training returns [S, E] of runs from scratch that differ only in the transfer and the seed.

    They are in the run's output folder or among the bundled curves; None if there are none.
    """
    curves, manifest = dict(find_own_curves(run)), pretrained.read()
    seeds, version = {one["seed"] for one in manifest["runs"]}, manifest["algorithm_version"]
    bundled = pretrained.training_returns({hash_from_scratch(run, seed, version) for seed in seeds})
    for digest, rows in bundled.groupby("config_hash", sort=False):
        curves.setdefault(str(digest), rows["return"].to_numpy())
    return np.stack(list(curves.values())) if curves else None


def find_own_curves(run: Run) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Yield config hash and training returns of the runs from scratch in the run's output folder."""
    output, arm = Path(run.config.output), run.config.with_arm(SCRATCH).arm_label
    for label in sorted({run.config.label, run.target.name}):
        for folder in sorted((output / label / arm).glob("seed=*")):
            try:
                result = read_result(folder)
                if result.config_hash == hash_from_scratch(run, result.seed):
                    returns = split(read_curve(folder))[0]["return"].to_numpy()
                    # A copied curve may be truncated at the end of a line.
                    if len(returns) == run.config.learn.episodes:
                        yield result.config_hash, returns
            except (ResultError, CurveError):
                continue


def hash_from_scratch(run: Run, seed: int, version: int | None = None) -> str:
    """Return the hash of the run without its transfer, with another seed, by a version of the algorithm."""
    config = dataclasses.replace(run.config.with_arm(SCRATCH), seed=seed)
    return hash_of(config, run.target, None, demonstrations=run.demonstrations, version=version)
