"""Where a run's numbers go: CSV always, wandb beside it."""

from __future__ import annotations

import csv
import dataclasses
import math
import os
import shutil
from pathlib import Path
from types import TracebackType
from typing import Any, Literal

from omegaconf import OmegaConf

from ship_trl.config import ConfigError, Logger, WandbMode, plain
from ship_trl.curve import COLUMNS, CURVE
from ship_trl.learn.train import Evaluated, Finished
from ship_trl.paths import replacing, writing
from ship_trl.result import Result
from ship_trl.run.plan import Run
from ship_trl.transfer.casebase import CONFIG


def row(event: Finished | Evaluated) -> dict[str, Any]:
    """Write an event as columns of `curve.csv`; a greedy evaluation fills its own columns only."""
    if isinstance(event, Finished):
        values = dataclasses.asdict(event)
        values["return"] = values.pop("episode_return")
        return known(values)
    sailed = event.sailed
    values = {
        "episode": event.episode,
        "steps": event.steps,
        "greedy_return": sailed.episode_return,
        "greedy_length": sailed.length,
        "greedy_outcome": sailed.outcome,
        "greedy_dcpa": sailed.dcpa,
    }
    return known(values)


def known(values: dict[str, Any]) -> dict[str, Any]:
    """Without what there is not: a loss before the first update, a DCPA without target ships."""
    return {key: v for key, v in values.items() if v is not None and (isinstance(v, str) or math.isfinite(v))}


def open_folder(run: Run) -> None:
    """Make the run's folder afresh and write its configuration.

    What is there is an unfinished run, or one that `overwrite=true` gives up.
    """
    try:
        shutil.rmtree(run.folder, ignore_errors=True)
        run.folder.mkdir(parents=True, exist_ok=True)
        with replacing(run.folder / CONFIG) as draft:
            OmegaConf.save(OmegaConf.structured(run.config), draft)
    except OSError as error:
        place = error.filename or run.folder
        raise ConfigError(f"output: {place} cannot be written: {error.strerror}") from None


class CsvTracker:
    """`curve.csv`, a line an event, written as it goes."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / CURVE
        self._file = self._path.open("w", newline="")
        self._writer = csv.DictWriter(self._file, COLUMNS, restval="", lineterminator="\n")
        self._writer.writeheader()

    def log(self, event: Finished | Evaluated) -> None:
        """Write one event; floats in full, so that equal runs give equal bytes."""
        with writing(self._path):
            self._writer.writerow(row(event))
            self._file.flush()

    def close(self) -> None:
        """End the file."""
        with writing(self._path):
            self._file.close()


class WandbTracker:
    """One wandb run: group = pair, job type = arm, curves over episodes, config, GIF, summary."""

    def __init__(self, run: Run) -> None:
        os.environ.setdefault("WANDB_SILENT", "true")
        import wandb

        config = run.config
        folder = Path(config.wandb.folder)
        mode: Literal["offline", "online"] = "online" if config.wandb.mode is WandbMode.online else "offline"
        folder.mkdir(parents=True, exist_ok=True)
        try:
            self._wandb = wandb.init(
                project=config.wandb.project,
                entity=config.wandb.entity,
                mode=mode,
                dir=str(folder),
                group=config.wandb.group or config.label,
                job_type=config.arm,
                name=f"{config.label}/{config.arm}/seed={config.seed}",
                tags=[config.profile],
                config=plain(config) | {"arm": config.arm, "config_hash": run.config_hash},
                reinit="finish_previous",
            )
        except (wandb.Error, OSError) as error:
            reason = " ".join(str(error).split())
            raise ConfigError(f"wandb: {reason}; wandb.mode=offline needs no account") from None
        self._wandb.define_metric("episode", hidden=True)
        for name in ("train/*", "greedy/*"):
            self._wandb.define_metric(name, step_metric="episode")

    def log(self, event: Finished | Evaluated) -> None:
        """Log one event under train/ or greedy/, with the episode as horizontal axis."""
        kind = "train" if isinstance(event, Finished) else "greedy"
        values = {"episode": event.episode}
        for key, value in row(event).items():
            name = key.removeprefix("greedy_")
            if name == "outcome":
                values |= {
                    f"{kind}/goal": int(value == "goal"),
                    f"{kind}/collision": int(value == "collision"),
                }
            elif key != "episode":
                values[f"{kind}/{name}"] = value
        self._wandb.log(values)

    def finish(self, result: Result, folder: Path) -> None:
        """Log the pictures and put the result into the summary."""
        import wandb

        self._wandb.log(
            {
                "episode": result.episodes,
                "greedy episode": wandb.Video(str(folder / "episode.gif"), format="gif"),
                "learning curve": wandb.Image(str(folder / "curve.png")),
            }
        )
        values = result.to_json()
        for key in ("scratch", "before", "best", "final"):
            self._wandb.summary.update({f"{key}/{name}": value for name, value in values[key].items()})
        self._wandb.summary.update({key: values[key] for key in ("best_known_return", "steps", "seconds")})

    def close(self, failed: bool) -> None:
        """End the run, so that the next one of a sweep is a run of its own."""
        self._wandb.finish(exit_code=int(failed))


class Tracker:
    """CSV and, with `logger=wandb`, wandb; a context that ends both however the run ends."""

    def __init__(self, run: Run) -> None:
        self._run = run

    def __enter__(self) -> Tracker:
        # wandb first: it can refuse, and then no file of an earlier run has been touched.
        self._wandb = WandbTracker(self._run) if self._run.config.logger is Logger.wandb else None
        open_folder(self._run)
        self._csv = CsvTracker(self._run.folder)
        return self

    def log(self, event: Finished | Evaluated) -> None:
        """Log one event everywhere."""
        self._csv.log(event)
        if self._wandb:
            self._wandb.log(event)

    def finish(self, result: Result) -> None:
        """Report the result."""
        if self._wandb:
            self._wandb.finish(result, self._run.folder)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            self._csv.close()
        finally:
            if self._wandb:
                self._wandb.close(failed=kind is not None)
