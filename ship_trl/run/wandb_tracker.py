"""A run's numbers and pictures in wandb, offline or online."""

from __future__ import annotations

import os
import shlex
from pathlib import Path
from typing import Literal

from ship_trl.config import ConfigError, WandbMode, plain
from ship_trl.learn.train import Evaluated, Finished
from ship_trl.result import Result
from ship_trl.run import console
from ship_trl.run.plan import Run
from ship_trl.run.rows import numbers


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
        """Log one event, with the episode as horizontal axis."""
        self._wandb.log({"episode": event.episode} | numbers(event))

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
        """End the run, so that the next one of a sweep is a run of its own, and say where it is."""
        folder, url = shown(Path(self._wandb.dir).parent), self._wandb.url
        self._wandb.finish(exit_code=int(failed))
        console.say(f"wandb: {url or f'{folder}; to upload it: wandb sync {shlex.quote(str(folder))}'}")


def shown(folder: Path) -> Path:
    """Name a folder from where the command was started, if it lies below."""
    return folder.relative_to(Path.cwd()) if folder.is_relative_to(Path.cwd()) else folder
