"""A run's numbers and pictures in wandb, offline or online."""

from __future__ import annotations

import os
import secrets
import shlex
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import WandbMode, plain
from ship_trl.files.disk import DISK, links, read_file, replacing
from ship_trl.files.result import Result
from ship_trl.run import console
from ship_trl.run.checkpoint import FOLDER
from ship_trl.run.rows import numbers
from ship_trl.run.run import Run

# Seconds: so long a run waits for a network at its start, and for its upload at its end.
START, END = 30.0, 120.0
# Bytes.
LONGEST_NOTE = 1000


def begin_wandb(run: Run) -> WandbTracker | None:
    """Begin a run in wandb; on a full disk say so, and go on without it.

    Raises:
        ConfigError: what was asked for is refused by wandb, or its folder cannot be made.
    """
    try:
        return WandbTracker(run)
    except Exception as error:  # wandb's own, and those of what it is made of
        if not full(error):
            raise ConfigError(f"wandb: {in_a_line(error)}; logger=csv does without") from None
        console.say(f"wandb: {in_a_line(error)}; the run goes on without it")
        return None


def full(error: BaseException | None) -> bool:
    """Whether an error comes of a disk that takes no more; wandb's own tell it in words alone."""
    if error is None:
        return False
    told = isinstance(error, OSError) and error.errno in DISK
    return told or "no space left" in str(error).lower() or full(error.__cause__ or error.__context__)


class WandbTracker:
    """One wandb run: group = pair, job type = arm, curves over episodes, config, GIF, summary.

    A run that goes on after it was stopped goes on in wandb too, under the same id. Whatever wandb lacks
    (network, account, room on the disk), the training goes on without it.
    """

    def __init__(self, run: Run) -> None:
        os.environ.setdefault("WANDB_SILENT", "true")

        self._note = run.folder / FOLDER / "wandb"
        self._mark = run.config_hash
        self._id = self._noted() or secrets.token_hex(4)
        self._folder = Path(run.config.wandb.folder)
        self._logged = 0
        self._failed = False
        online = run.config.wandb.mode is WandbMode.online
        if linked := links(self._folder / "wandb", self._folder):
            # It lies in the output, which may be a stranger's.
            raise ConfigError(f"{linked[0]} is a link; allowed: wandb.folder= with where it leads")
        self._folder.mkdir(parents=True, exist_ok=True)
        try:
            self._wandb = self._begin(run, "online" if online else "offline")
        except Exception as error:  # wandb's own, and those of what it is made of
            if not online:
                raise
            console.say(f"wandb: {in_a_line(error)}; this run is logged offline")
            # The one that could not be begun is still in wandb's hands.
            self._id = secrets.token_hex(4)
            self._wandb = self._begin(run, "offline")
        self._wandb.define_metric("episode", hidden=True)
        for name in ("train/*", "greedy/*"):
            self._wandb.define_metric(name, step_metric="episode")

    def _begin(self, run: Run, mode: Literal["online", "offline"]) -> Any:
        """Begin the run in wandb, or go on with it there."""
        import wandb

        config = run.config
        return wandb.init(
            project=config.wandb.project,
            entity=config.wandb.entity,
            mode=mode,
            dir=str(self._folder),
            id=self._id,
            resume="allow" if mode == "online" else None,
            group=config.wandb.group or config.label,
            job_type=config.arm_label,
            name=f"{config.label}/{config.arm_label}/seed={config.seed}",
            tags=[config.profile],
            config=plain(config) | {"arm": config.arm_label, "config_hash": run.config_hash},
            reinit="finish_previous",
            settings=wandb.Settings(init_timeout=START, finish_timeout=END, finish_timeout_raises=True),
        )

    def _noted(self) -> str | None:
        """Read the id under which this run was begun."""
        try:
            mark, known = read_file(self._note, most=LONGEST_NOTE).decode().split()
        except (OSError, ValueError):
            return None
        return known if mark == self._mark and known.isalnum() else None

    def remember(self) -> None:
        """Note the id beside the checkpoints; take away what offline files a stopped process left under it.

        The new files will hold all of the run.
        """
        self._note.parent.mkdir(exist_ok=True)
        with replacing(self._note) as draft:
            draft.write_text(f"{self._mark} {self._id}")
        here = Path(self._wandb.dir).parent
        for folder in self._folder.glob(f"wandb/offline-run-*-{self._id}"):
            if folder.resolve() != here.resolve():
                shutil.rmtree(folder, ignore_errors=True)

    def _try(self, call: Callable[[], object]) -> None:
        """Call wandb; its first error is said, whatever it is, and then wandb is left alone."""
        if self._failed:
            return
        try:
            call()
        except Exception as error:
            self._failed = True
            console.say(f"wandb: {in_a_line(error)}; the run goes on without it")

    def log(self, values: Mapping[str, Any]) -> None:
        """Log one event's row, with the episode as horizontal axis; once, however often a run is stopped."""
        self._logged += 1
        # A run that goes on is given its first events once more, and wandb's server has them.
        if self._logged > self._wandb.starting_step:
            self._try(lambda: self._wandb.log({"episode": values["episode"]} | numbers(values)))

    def finish(self, result: Result, folder: Path) -> None:
        """Log the pictures and put the result into the summary."""
        self._try(lambda: self._log_result(result, folder))

    def _log_result(self, result: Result, folder: Path) -> None:
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
        self._try(lambda: self._wandb.finish(exit_code=int(failed)))
        # What a server did not take is in the folder whole.
        uploaded = url if url and not self._failed else None
        console.say(f"wandb: {uploaded or f'{folder}; to upload it: wandb sync {shlex.quote(str(folder))}'}")


def in_a_line(error: Exception) -> str:
    """Give an error's text as one line."""
    return " ".join(str(error).split()).rstrip(".") or type(error).__name__


def shown(folder: Path) -> Path:
    """Name a folder from where the command was started, if it lies below."""
    return folder.relative_to(Path.cwd()) if folder.is_relative_to(Path.cwd()) else folder
