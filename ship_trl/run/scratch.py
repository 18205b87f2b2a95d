"""Learning from scratch, to stand beside a transfer: runs of the same target. No torch."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ship_trl.config.arm import SCRATCH
from ship_trl.config.types import Config
from ship_trl.files.curve import CurveError, read_curve, split
from ship_trl.files.result import ResultError, read_result
from ship_trl.policies import pretrained
from ship_trl.run.plan import hash_of
from ship_trl.run.run import Run


def scratch_returns(run: Run) -> NDArray[np.float64] | None:
    """Find runs from scratch that differ from a transfer in nothing but the transfer and the seed.

    They are those in the run's output folder, and those that come with the package (`pretrained`).

    Returns:
        Raw training returns [S, E] of S seeds, or None where there is no such run.
    """
    curves = dict(sailed_here(run))
    seeds = {one["seed"] for one in pretrained.read()["runs"]}
    came = pretrained.training_returns({hash_from_scratch(run, seed) for seed in seeds})
    for digest, rows in came.groupby("config_hash", sort=False):
        curves.setdefault(str(digest), rows["return"].to_numpy())
    return np.stack(list(curves.values())) if curves else None


def sailed_here(run: Run) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Yield digest and training returns of the runs from scratch below the run's output folder."""
    output = Path(run.config.output)
    for label in sorted({run.config.label, run.target.name}):
        for folder in sorted((output / label / from_scratch(run, 0).arm_label).glob("seed=*")):
            try:
                result = read_result(folder)
                if result.config_hash == hash_from_scratch(run, result.seed):
                    returns = split(read_curve(folder))[0]["return"].to_numpy()
                    # A copy may have been cut short at the end of a line.
                    if len(returns) == run.config.learn.episodes:
                        yield result.config_hash, returns
            except (ResultError, CurveError):
                continue


def hash_from_scratch(run: Run, seed: int) -> str:
    """Give the digest that the run would have without its transfer, with another seed."""
    return hash_of(from_scratch(run, seed), run.target, None, demonstrations=run.demonstrations)


def from_scratch(run: Run, seed: int) -> Config:
    """Give the run's configuration without its transfer, with another seed."""
    return dataclasses.replace(run.config.with_arm(SCRATCH), seed=seed)
