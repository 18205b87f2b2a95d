"""A few dozen wrong inputs through the real commands, each in a process and a folder of its own."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

from tests.command import environment
from tests.fuzz.judge import FaultError, check_line, listing

# Longer than the slowest start of Python and Hydra on a busy machine.
SECONDS = 240
RUN, STUDY = "ship_trl", "ship_trl.study"


@dataclass(frozen=True)
class Command:
    """A module and its words."""

    module: str
    words: tuple[str, ...]

    def __str__(self) -> str:
        return " ".join((self.module, *self.words))


def run_with(*words: str) -> Command:
    """A run that is right but for these words."""
    return Command(RUN, ("+pair=high", "layers=3", *words))


# What only the whole command shows: how it takes a word, and what it leaves in the folder.
SHORT = (
    run_with("learn.replay_size=1000000000000"),
    run_with("learn.num_envs=1000000000"),
    run_with("network.hidden=1000000000"),
    run_with("seed=" + "9" * 400),
    run_with("output=${case_base}"),
    Command(RUN, ("target=fifo.yaml", "method=scratch")),
)
LONG = (
    *SHORT,
    run_with("learn.lr=1e400"),
    run_with("learn.lr=nan"),
    run_with("learn.episodes=" + "9" * 30),
    run_with("learn.batch_size=1000000", "learn.replay_size=1000000"),
    run_with("world.actions=[[1e308,0]]"),
    run_with("world.dt=1e-320"),
    run_with("world.goal_distance=1e30"),
    run_with("world.reward.goal=1e300"),
    run_with("network.conv=[[4096,1,1],[4096,84,1]]"),
    run_with("output=" + "a" * 300),
    run_with("output=/dev/null/x"),
    run_with("output=/proc/x"),
    run_with("device=cuda:x"),
    run_with("layers=\u65e5\u672c"),
    run_with("seed=${oc.env:NOWHERE}"),
    run_with("seed='"),
    run_with('seed="'),
    run_with("seed=a\nb"),
    run_with("\u00fc=3"),
    run_with("="),
    run_with("~seed"),
    run_with("++pair=../x"),
    run_with("+learn=banana"),
    run_with("hydra/sweeper=banana"),
    Command(RUN, ("target=/dev/zero", "method=scratch")),
    Command(RUN, ("target=large.yaml", "method=scratch")),
    Command(RUN, ("target=laughs.yaml", "method=scratch")),
    Command(RUN, ("target=folder.yaml", "method=scratch")),
    Command(RUN, ("target=bytes.yaml", "method=scratch")),
    Command(RUN, ("target=" + "a" * 300, "method=scratch")),
    Command(STUDY, ("seeds=" + "9" * 400,)),
    Command(STUDY, ("seeds=1e400",)),
    Command(STUDY, ("pairs=[[high]]",)),
    Command(STUDY, ("overrides=[learn.replay_size=1000000000000]",)),
    Command(STUDY, ("\x1b[31m=3",)),
    Command(STUDY, ("output=${output}",)),
)


def prepare(folder: Path) -> None:
    """Put case files there that are none."""
    from os import mkfifo

    from tests.fuzz.case_files import GOOD, laughs

    mkfifo(folder / "fifo.yaml")
    (folder / "folder.yaml").mkdir()
    (folder / "bytes.yaml").write_bytes(b"\xff\xfe\x00")
    (folder / "laughs.yaml").write_text(laughs(30, 2, merge=True) + GOOD)
    ship = GOOD.splitlines()[-1] + "\n"
    (folder / "large.yaml").write_text(GOOD + ship * 1_000_000)


def attempt(command: Command, folder: Path) -> bool:
    """Give a command in a prepared folder; it must refuse in one line, and leave everything as it was."""
    before = listing(folder)
    line = [sys.executable, "-m", command.module, *command.words]
    try:
        done = subprocess.run(
            line, cwd=folder, env=environment(), capture_output=True, text=True, timeout=SECONDS, check=False
        )
    except subprocess.TimeoutExpired:
        raise FaultError(f"{command}: not done within {SECONDS} s") from None
    lines = done.stderr.splitlines()
    if done.returncode != 1 or done.stdout or len(lines) != 1 or not lines[0].startswith("ship_trl: "):
        raise FaultError(f"exit code {done.returncode}: {done.stdout[-200:]}{done.stderr[-600:]}")
    check_line(
        lines[0].removeprefix("ship_trl: "), "study" if command.module == STUDY else "run", str(command)
    )
    if listing(folder) != before:
        raise FaultError(f"files were left or changed: {listing(folder) ^ before}")
    return False
