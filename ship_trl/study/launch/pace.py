"""Estimates how long a run takes on this machine: from finished runs, or from two short ones."""

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

# With so many finished runs their mean is used.
MIN_FINISHED = 4
# Episodes of the two short runs; a line through their times gives the time of a whole run.
SHORT, LONG = 8, 40
CASE = "4"


def seconds_per_run(jobs: list[Job], config: StudyConfig, episodes: int) -> tuple[float, str]:
    """Return the seconds of a run beside others, and what they were measured by."""
    known = [result.seconds for result in (finished(job, config) for job in jobs) if result]
    if len(known) >= MIN_FINISHED:
        return statistics.mean(known), f"the {len(known)} finished runs"
    if episodes <= LONG:
        return time_runs(config, episodes), f"runs of {episodes} episodes"
    # The first run compiles kernels, which a fresh installation has not in its cache.
    time_runs(config, 1)
    short, long = time_runs(config, SHORT), time_runs(config, LONG)
    each = max(0.0, (long - short) / (LONG - SHORT))
    return short + each * (episodes - SHORT), f"runs of {SHORT} and {LONG} episodes"


def time_runs(config: StudyConfig, episodes: int) -> float:
    """Return the mean seconds of short runs from scratch, as many at once as the study runs.

    Raises:
        RuntimeError: they failed; the text is the last line of their error output.
    """
    children: list[subprocess.Popen[str]] = []
    with tempfile.TemporaryDirectory() as folder, ExitStack() as ends:
        for k in range(processes(config)):
            line = (f"target={CASE}", "method=scratch", f"profile={config.profile}", *config.run_overrides)
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
            # If one fails, the others end before their folder is removed.
            ends.enter_context(child)
            ends.callback(child.kill)
            children.append(child)
        for child in children:
            _, said = child.communicate()
            if child.returncode != 0:
                raise RuntimeError(said.strip().splitlines()[-1] if said.strip() else "a short run failed")
        results = [read_result(path.parent) for path in Path(folder).glob(f"**/scratch/**/{RESULT}")]
    return statistics.mean(result.seconds for result in results)
