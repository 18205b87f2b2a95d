"""How long a study will take on this machine: measured, by what is finished or by short runs."""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path

from ship_trl.files.result import RESULT, read_result
from ship_trl.run.launchers import die_with_parent
from ship_trl.study.launch.launch import finished, processes
from ship_trl.study.plan.config import StudyConfig
from ship_trl.study.plan.jobs import Job

# Results that say how long a run takes, if there are so many.
ENOUGH = 4
# Episodes of the two short runs whose times make a line.
SHORT, LONG = 8, 40
CASE = "4"


def seconds_per_run(jobs: list[Job], config: StudyConfig, episodes: int) -> tuple[float, str]:
    """Seconds of one run among as many as go on at once, and by what that was measured."""
    known = [result.seconds for result in (finished(job, config) for job in jobs) if result]
    if len(known) >= ENOUGH:
        return statistics.mean(known), f"the {len(known)} finished runs"
    if episodes <= LONG:
        return timed(config, episodes), f"runs of {episodes} episodes"
    # The first of all compiles what a fresh installation has not yet compiled.
    timed(config, 1)
    short, long = timed(config, SHORT), timed(config, LONG)
    each = max(0.0, (long - short) / (LONG - SHORT))
    return short + each * (episodes - SHORT), f"runs of {SHORT} and {LONG} episodes"


def timed(config: StudyConfig, episodes: int) -> float:
    """Mean seconds of runs of so many episodes from scratch, with updates from the start, several at once.

    Raises:
        RuntimeError: they failed; the text is the last line of their complaint.
    """
    children: list[subprocess.Popen[str]] = []
    with tempfile.TemporaryDirectory() as folder, ExitStack() as ends:
        for k in range(processes(config)):
            line = (f"target={CASE}", "method=scratch", f"profile={config.profile}", *config.of_runs)
            short = (
                f"learn.episodes={episodes}",
                "learn.warmup_steps=100",
                f"seed={k}",
                f"output={folder}/{k}",
            )
            child = subprocess.Popen(
                [sys.executable, "-m", "ship_trl", *line, *short],
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
                preexec_fn=die_with_parent,
            )
            # None outlives the folder it writes to, if another one fails.
            ends.enter_context(child)
            ends.callback(child.kill)
            children.append(child)
        for child in children:
            _, said = child.communicate()
            if child.returncode != 0:
                raise RuntimeError(said.strip().splitlines()[-1] if said.strip() else "a short run failed")
        results = [read_result(path.parent) for path in Path(folder).glob(f"**/scratch/**/{RESULT}")]
    return statistics.mean(result.seconds for result in results)
