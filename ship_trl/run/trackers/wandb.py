"""Log a run's numbers and pictures to wandb, offline or online."""

from __future__ import annotations

import os
import secrets
import shlex
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import WandbMode
from ship_trl.files.curve import Row
from ship_trl.files.disk import atomic_write, read_file
from ship_trl.files.record import RunRecord
from ship_trl.run import console
from ship_trl.run.history import to_numbers
from ship_trl.run.plan import CHECKPOINTS, Run, tracked_settings

# Seconds to wait for the network when a run starts, and for the upload when it ends.
INIT_TIMEOUT, FINISH_TIMEOUT = 30.0, 120.0
# Letters of a tag; wandb refuses longer ones.
MAX_TAG = 64
# Of the file with the hash of a run's settings and its id in wandb.
MAX_NOTE_BYTES = 1000


class WandbTracker:
    """One wandb run: group = study or pair, job type = arm, curves over episodes, config, GIF, summary.

    A resumed run continues in wandb under the same id. If wandb fails (network, account, full disk), the
    training continues without it.

    Raises:
        ConfigError: wandb refuses the settings, or cannot write its files.
    """

    def __init__(self, run: Run) -> None:
        os.environ.setdefault("WANDB_SILENT", "true")
        self._run = run
        self._note = run.folder / CHECKPOINTS / "wandb"
        self._id = self._read_id() or secrets.token_hex(4)
        self._folder = Path(run.config.wandb.folder)
        self._logged, self._failed = 0, False
        self._wandb: Any = None
        modes: tuple[Literal["online", "offline"], ...] = ("online", "offline")
        for mode in modes[run.config.wandb.mode is WandbMode.offline :]:
            try:
                self._wandb = self._init(mode)
                break
            except Exception as error:  # from wandb or its dependencies
                if mode == "offline":
                    raise ConfigError(f"wandb: {describe(error)}; logger=csv trains without wandb") from None
                console.say(f"wandb: {describe(error)}; this run is logged offline")
                # A new id, because wandb still holds the id of the run that it could not start.
                self._id = secrets.token_hex(4)

    def _init(self, mode: Literal["online", "offline"]) -> Any:
        """Start the run in wandb, or resume it there."""
        import wandb

        config, settings = self._run.config, tracked_settings(self._run)
        tags = [settings[key] for key in ("task", "arm", "algo", "method", "profile")]
        tags += [f"layers={config.layers}"] * (config.layers is not None)
        self._folder.mkdir(parents=True, exist_ok=True)
        started = wandb.init(
            project=config.wandb.project,
            entity=config.wandb.entity,
            mode=mode,
            dir=str(self._folder),
            id=self._id,
            resume="allow" if mode == "online" else None,
            group=config.wandb.group or config.label,
            job_type=config.arm_label,
            name=f"{config.label}/{config.arm_label}/seed={config.seed}",
            tags=list(dict.fromkeys(tag[:MAX_TAG] for tag in tags)),
            config=settings,
            reinit="finish_previous",
            settings=wandb.Settings(
                init_timeout=INIT_TIMEOUT, finish_timeout=FINISH_TIMEOUT, finish_timeout_raises=True
            ),
        )
        started.define_metric("episode", hidden=True)
        for name in ("train/*", "greedy/*"):
            started.define_metric(name, step_metric="episode")
        self._place, self._url = Path(started.dir).parent, started.url
        return started

    def _read_id(self) -> str | None:
        """Read the wandb id of this run, or return None if it was not started before."""
        try:
            config_hash, wandb_id = read_file(self._note, MAX_NOTE_BYTES).decode().split()
        except (OSError, ValueError):
            return None
        return wandb_id if config_hash == self._run.config_hash and wandb_id.isalnum() else None

    def begin(self) -> None:
        """Write the id next to the checkpoints, and delete the offline files that a stopped process left.

        The new offline files will hold the complete run.
        """
        with atomic_write(self._note) as draft:
            draft.write_text(f"{self._run.config_hash} {self._id}")
        for folder in self._folder.glob(f"wandb/offline-run-*-{self._id}"):
            if folder.resolve() != self._place.resolve():
                shutil.rmtree(folder, ignore_errors=True)

    def _try(self, call: Callable[[], object]) -> None:
        """Call wandb; at the first error print a message and disable wandb."""
        if self._failed:
            return
        try:
            call()
        except Exception as error:
            self._failed = True
            console.say(f"wandb: {describe(error)}; the run continues without wandb")

    def log(self, row: Row) -> None:
        """Log the row of an event, with the episode as horizontal axis; skip rows that wandb has already."""
        self._logged += 1
        # A resumed run logs its earlier events again, but the server has them already.
        if self._logged > self._wandb.starting_step:
            self._try(lambda: self._wandb.log({"episode": row["episode"]} | to_numbers(row)))

    def finish(self, result: RunRecord) -> None:
        """Log the pictures and put the result into the summary."""
        self._try(lambda: self._log_result(result))

    def _log_result(self, result: RunRecord) -> None:
        import wandb

        gif, picture = (str(self._run.folder / name) for name in ("episode.gif", "curve.png"))
        pictures = {"greedy episode": wandb.Video(gif, format="gif"), "learning curve": wandb.Image(picture)}
        self._wandb.log({"episode": result.episodes} | pictures)
        values = result.to_json()
        for key in ("untrained", "before", "best", "final"):
            self._wandb.summary.update({f"{key}/{name}": value for name, value in values[key].items()})
        self._wandb.summary.update({key: values[key] for key in ("best_known_return", "steps", "seconds")})

    def close(self, failed: bool) -> None:
        """Finish the run in wandb, so that the next run of a sweep is a new one, and print where it is."""
        self._try(lambda: self._wandb.finish(exit_code=int(failed)))
        here = Path.cwd()
        folder = self._place.relative_to(here) if self._place.is_relative_to(here) else self._place
        # If the upload failed, the folder still holds the whole run.
        uploaded = self._url and not self._failed
        sync = f"{folder}; to upload it: wandb sync {shlex.quote(str(folder))}"
        console.say(f"wandb: {self._url if uploaded else sync}")


def describe(error: Exception) -> str:
    """Return an error's message as one line."""
    return " ".join(str(error).split()).rstrip(".") or type(error).__name__


start = WandbTracker
