"""Write the files of a finished training: last network, pictures, result, and case base entry."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from ship_trl import __version__
from ship_trl.config.arm import SCRATCH
from ship_trl.config.network import non_default_network
from ship_trl.files.curve import RunError
from ship_trl.files.record import SCHEMA_VERSION, RunRecord, SourceReturns, read_run
from ship_trl.learn.train import Evaluated
from ship_trl.policies import pretrained
from ship_trl.policies.reference import best_known_return, random_return
from ship_trl.run import console
from ship_trl.run.history import to_evaluation, to_row
from ship_trl.run.plan import ALGORITHM_VERSION, Run, hash_of
from ship_trl.run.process import processor_name
from ship_trl.run.setup import Parts
from ship_trl.sim.state import first_case
from ship_trl.sim.suites import describe
from ship_trl.transfer.casebase import PLANS, POLICY_LAST, CaseBase, StoredNetwork
from ship_trl.transfer.weights import save_weights
from ship_trl.view.charts import draw_curve, draw_transfer
from ship_trl.view.film import write_gif


def write_files(run: Run, parts: Parts, known: float | None) -> None:
    """Write the last network and the pictures into the run's folder; `known` is the best known return."""
    history, config, folder = parts.history, run.config, run.folder
    about = {"config_hash": run.config_hash, "episode": config.learn.episodes}
    save_weights(folder / POLICY_LAST, parts.algorithm.network, about)
    draw_curve(folder / "curve.png", history.rows, known, run.title)
    if parts.origin is not None and (scratch := scratch_returns(run)) is not None:
        returns = [row["return"] for row in history.finished]
        draw_transfer(folder / console.TRANSFER, config.arm_label, returns, scratch, known, run.title)
    origin = "" if run.arm.is_scratch else f" from {describe(str(config.source))}"
    title = f"{config.arm_label}{origin}, seed {config.seed}"
    if len(run.target.cases) > 1:
        title += f", suite {run.target.name}"
    best = parts.evaluate(history.network)[0]
    case = first_case(run.target, best.states[0])
    rasteriser, network = parts.eval_env.rasteriser, history.network
    write_gif(folder / "episode.gif", case, config.world, best, rasteriser, title, network)


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
                found = read_run(folder)
                # A copied curve may be truncated at the end of a line.
                if found.config_hash == hash_from_scratch(run, found.seed) and (
                    len(found.training.returns) == run.config.learn.episodes
                ):
                    yield found.config_hash, found.training.returns
            except RunError:
                continue


def hash_from_scratch(run: Run, seed: int, version: int | None = None) -> str:
    """Return the hash of the run without its transfer, with another seed, by a version of the algorithm."""
    config = dataclasses.replace(run.config.with_arm(SCRATCH), seed=seed)
    return hash_of(config, run.target, None, demonstrations=run.demonstrations, version=version)


def make_result(run: Run, parts: Parts, known: float | None, seconds: float) -> RunRecord:
    """Make the result of a training that took `seconds`."""
    history, config = parts.history, run.config
    outcomes = [row["outcome"] for row in history.finished]
    return RunRecord(
        folder=run.folder,
        pair=config.label,
        source=None if run.arm.is_scratch else str(config.source),
        target=str(config.target),
        **run.arm.keys,
        arm=config.arm_label,
        seed=config.seed,
        profile=config.profile,
        config_hash=run.config_hash,
        source_network=parts.origin,
        best_known_return=known,
        random_return=random_return(run.target, config.world, fast=config.fast),
        scratch=to_evaluation(to_row(Evaluated(0, 0, parts.scratch))),
        before=to_evaluation(history.evaluated[0]),
        best=to_evaluation(history.best),
        final=to_evaluation(history.evaluated[-1]),
        draws=parts.draws,
        episodes=config.learn.episodes,
        steps=parts.training.steps,
        training_goal_rate=outcomes.count("goal") / len(outcomes),
        training_collision_rate=outcomes.count("collision") / len(outcomes),
        device=str(parts.eval_env.device),
        precision=str(parts.algorithm.dtype).removeprefix("torch."),
        backend=parts.algorithm.backend,
        algorithm_version=ALGORITHM_VERSION,
        schema_version=SCHEMA_VERSION,
        ship_trl=__version__,
        torch=torch.__version__,
        processor=processor_name(),
        seconds=round(seconds, 1),
        teacher=parts.teacher,
        on_source=measure_source(run, parts),
    )


def measure_source(run: Run, parts: Parts) -> SourceReturns | None:
    """Return what a transfer kept of its source; None if it was not measured from the start."""
    check, suite, rows = parts.source_check, run.source_suite, parts.history.evaluated
    if check is None or suite is None:
        return None
    config = run.config
    return SourceReturns(
        network=check.source_return,
        before=rows[0]["source_return"],
        best=check.measure(parts.history.network),
        final=rows[-1]["source_return"],
        random=random_return(suite, config.world, fast=config.fast),
        best_known=best_known_return(suite, config.world, Path(config.case_base) / PLANS),
    )


def retain(run: Run, result: RunRecord) -> StoredNetwork:
    """Store a finished run's network in the case base, for later targets (section 4.2)."""
    values, config = result.to_json(), run.config
    scores = {key: values[key] for key in ("best", "final", "best_known_return")}
    network = non_default_network(config.network)
    return CaseBase(Path(config.case_base)).retain(
        run.target, run.entry_arm, config.seed, run.config_hash, scores, run.folder, network
    )
