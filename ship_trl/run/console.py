"""What a run shows in the terminal: progress with time left, then a short table."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeRemainingColumn,
)
from rich.table import Table

from ship_trl.learn.train import Evaluated, Finished
from ship_trl.result import Result

console = Console()


def say(text: str) -> None:
    """One line."""
    console.print(text, highlight=False, markup=False, soft_wrap=True)


def progress(
    title: str, episodes: int, events: Iterable[Finished | Evaluated], one_of_many: bool
) -> Iterator[Finished | Evaluated]:
    """Pass events on, and show episodes done, time left, and the last returns meanwhile.

    Of a grid's runs, which share the terminal, only the title is shown.
    """
    columns = (
        BarColumn(bar_width=20),
        MofNCompleteColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("return {task.fields[now]:>7}  greedy {task.fields[greedy]:>7}"),
    )
    say(title)
    with Progress(*columns, console=console, disable=one_of_many) as bar:
        task = bar.add_task(title, total=episodes, now="", greedy="")
        for event in events:
            if isinstance(event, Finished):
                bar.update(task, completed=event.episode, now=f"{event.episode_return:.1f}")
            else:
                bar.update(task, greedy=f"{event.sailed.episode_return:.1f}")
            yield event


def say_result(result: Result, folder: Path) -> None:
    """Say the result of one run of a grid, in a line."""
    best, final = result.best, result.final
    say(
        f"{result.title}: best {best.episode_return:.1f} ({best.outcome}), final {final.episode_return:.1f} "
        f"({final.outcome}) of {result.best_known_return:.1f}, {result.seconds:.0f} s; {folder}"
    )


def show_result(result: Result, folder: Path) -> None:
    """Print the table at the end of a run."""
    table = Table(title=result.title, title_justify="left")
    for name in ("greedy policy", "return", "of best", "ends with", "steps", "DCPA", "episode"):
        table.add_column(name, justify="left" if name in ("greedy policy", "ends with") else "right")
    known = result.best_known_return
    for name, row in (
        ("scratch, untrained", result.scratch),
        ("before training", result.before),
        ("best", result.best),
        ("final", result.final),
    ):
        # A share of the best says something only where both are gains.
        share = f"{row.episode_return / known:.0%}" if known > 0 and row.episode_return > 0 else "-"
        dcpa = "-" if row.dcpa is None else f"{row.dcpa:.0f} m"
        table.add_row(
            name, f"{row.episode_return:.1f}", share, row.outcome, str(row.length), dcpa, str(row.episode)
        )
    table.add_row("best known (planner)", f"{known:.1f}", "100%", "", "", "", "")
    console.print(table)
    say(
        f"{result.episodes} episodes, {result.steps} steps, {result.seconds:.0f} s; "
        f"goal in {result.training_goal_rate:.0%} of the training episodes, "
        f"collision in {result.training_collision_rate:.0%}"
    )
    say(f"{folder}: result.json, curve.csv, curve.png, episode.gif, policy.safetensors")
