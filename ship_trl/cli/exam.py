"""`python -m ship_trl exam POLICY...`: where does a policy fail? Examine it, or search for a failure.

POLICY is the same as for `evaluate`; of a result folder, the best network is taken. The exam has one target
ship: its course, its speed, and when and how near it would pass are spread evenly over the bounds of the
suite (default: target=traffic_near), speeds over those of all classes of encounter. --adversary N searches
for failures with N target ships, within the suite's bounds, and compares with scenes that the suite draws.
Scenes that no held manoeuvre solves are left out. --write keeps failures as a suite: target=NAME takes
conf/suite/NAME.yaml.
"""

from __future__ import annotations

import math
import sys
from argparse import Namespace
from collections.abc import Iterable
from dataclasses import astuple, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_number, add_output, add_policies, make_parser
from ship_trl.config.errors import ConfigError, require
from ship_trl.config.paths import is_name
from ship_trl.policies.registry import Entry
from ship_trl.run.entries import drop_last_networks, find_entries
from ship_trl.sim.cases import MAX_SHIPS, SHIP_COLUMNS, TABLE_COLUMNS, Scene

if TYPE_CHECKING:
    from torch import Tensor

Scenes = Annotated[int, Field(ge=1, le=10**7)]
Kept = Annotated[int, Field(ge=1, le=10**4)]
Ships = Annotated[int, Field(ge=1, le=MAX_SHIPS)]
Tries = Annotated[int, Field(ge=1, le=10**6)]


def main(arguments: list[str] | None = None) -> None:
    """Print the table, and write the files."""
    parser = make_parser("exam", __doc__)
    add_policies(parser, None, "of what is drawn")
    add_number(parser, "--scenes", Scenes, 100_000, "of the exam; default: 100000")
    add_output(parser, "--picture", (".png",), "maps of the shares of failures by bearing and range")
    add_output(parser, "--csv", (".csv",), "a row for each cell of speed, bearing, course and range")
    add_number(parser, "--adversary", Ships, None, "search with N target ships, 1 to 3, in place of the exam")
    add_number(parser, "--searches", Tries, 100, "of the adversary; default: 100")
    add_number(parser, "--tries", Tries, 1000, "after which a search gives up; default: 1000")
    add_output(parser, "--write", (".yaml",), "a new suite of the worst failures, a table beside it")
    add_number(parser, "--worst", Kept, 100, "scenes of that suite at most; default: 100")
    options = parser.parse_intermixed_args(arguments)
    with refusals():
        words = options.words + ["target=traffic_near"] * (
            not any(w.startswith("target=") for w in options.words)
        )
        entries = drop_last_networks(find_entries(words, options.colour))
        check(entries, options)

        from ship_trl.run.process import configure_process

        configure_process()
        (examine if options.adversary is None else oppose)(entries, options)
        for path in filter(None, (options.csv, options.picture)):
            sys.stdout.write(f"{path}\n")


def check(entries: list[Entry], options: Namespace) -> None:
    """Check the options against the entries.

    Raises:
        ConfigError: an option does not fit them.
    """
    for entry in entries:
        require(entry.suite.traffic is not None, "target", "a suite of random encounters", entry.suite.name)
        if (entry.suite, entry.world) != (entries[0].suite, entries[0].world):
            raise ConfigError("target: several suites or worlds; allowed: one")
    if options.adversary is not None and (options.csv or options.picture):
        raise ConfigError("--csv, --picture: of the exam; allowed without --adversary")
    if options.write is not None:
        path, traffic = options.write, entries[0].suite.traffic
        taken = path.exists() or path.with_suffix(".csv").exists()
        require(is_name(path.stem) and not taken, "--write", "a new file, whose table is new too", path)
        require(len(entries) == 1, "--write", "of one policy", f"{len(entries)}")
        holds = traffic is not None and not traffic.reacting
        require(holds, "--write", "of a suite whose ships hold their course", entries[0].suite.name)


def examine(entries: list[Entry], options: Namespace) -> None:
    """Examine policies, print shares of failures by class of encounter, and write the files."""
    import torch

    from ship_trl.policies.exam import CELL, RING, SECTOR, draw_exam, run_scenes
    from ship_trl.run.console import show, show_share
    from ship_trl.study.report.tables import write_csv

    states, scenes = draw_exam(entries[0].suite, entries[0].world, options.scenes, options.seed)
    scenes, rows, maps, lines = scenes.assign(unsolvable=~scenes["is_solvable"]), [], {}, []
    states = states[torch.tensor(scenes["is_solvable"].to_numpy())]
    for entry in entries:
        with show_share(entry.label) as show_done:
            ends = run_scenes(entry, states, options.seed, show_done)
        found = scenes[scenes["is_solvable"]].assign(
            failed=~ends.goal, collision=ends.collision, timeout=~ends.goal & ~ends.collision
        )
        found = found.assign(margin=ends.margin, row=range(len(found)))
        for name, some in (("all", found), *found.groupby("encounter")):
            shares = (f"{some[end].mean():.2%}" for end in ("failed", "collision", "timeout"))
            rows.append((entry.label, str(name), f"{len(some)}", *shares))
        maps[f"{entry.label}: fails in {found['failed'].mean():.2%}"] = found
        cells = scenes.join(found[["collision", "timeout"]]).groupby(list(CELL))
        table = cells[["unsolvable", "collision", "timeout"]].sum().astype(int)
        table = table.assign(policy=entry.label, scenes=cells.size()).reset_index()
        lines += table[["policy", *CELL, "scenes", *table.columns[len(CELL) : -2]]].to_dict("records")
    total, lost = len(scenes), int(scenes["unsolvable"].sum())
    cells = scenes.groupby(list(CELL))["unsolvable"]
    title = (
        f"{total} scenes of one target ship in {cells.ngroups} cells. No held manoeuvre solves {lost} scenes "
        f"in {int(cells.any().sum())} cells, all scenes of {int(cells.all().sum())}: they are left out."
    )
    show(("policy", "encounter", "scenes", "failures", "collision", "timeout"), rows, title=title)
    if options.csv is not None:
        write_csv(options.csv, lines)
    if options.picture is not None:
        from ship_trl.view.polar import draw_failures

        draw_failures(options.picture, maps, SECTOR, RING)
    if options.write is not None:
        # The worst one of each cell comes first.
        failed = found[found["failed"]].sort_values("margin", kind="stable")
        failed = failed.assign(turn=failed.groupby(list(CELL)).cumcount())
        worst = failed.sort_values(["turn", "margin"], kind="stable")["row"].to_numpy()
        write_suite(options.write, entries[0], states[torch.from_numpy(worst[: options.worst].copy())])


def oppose(entries: list[Entry], options: Namespace) -> None:
    """Search for failures, print how many tries they take, and write the scenes that were found."""
    import numpy as np

    from ship_trl.policies.adversary import search
    from ship_trl.run.console import show, show_share

    rows = []
    for entry in entries:
        for is_random in (True, False):
            name = "random" if is_random else "adversary"
            with show_share(f"{entry.label}, {name}") as show_done:
                found = search(
                    *(entry, options.adversary, options.searches, options.tries, options.seed, is_random),
                    show_done,
                )
            tries = (np.quantile(found.tries, share, method="inverted_cdf") for share in (0.5, 0.9))
            told = (f"{one:.0f}" if np.isfinite(one) else f"more than {options.tries}" for one in tries)
            ends = f"{len(found.scenes)} of {options.searches}", f"{int(found.collision.sum())}"
            rows.append((entry.label, name, *ends, *told))
    headings = ("policy", "scenes", "failures", "collisions", "tries, median", "90 %")
    show(headings, rows, title=f"Tries until a policy fails, {options.adversary} target ships")
    if options.write is not None:
        write_suite(options.write, entries[0], found.scenes[: options.worst])


def write_suite(path: Path, entry: Entry, states: Tensor) -> None:
    """Write states [N, S] as a suite and its table of scenes, without plans; without states, nothing."""
    from ship_trl.files.disk import atomic_write
    from ship_trl.policies.exam import describe_ships
    from ship_trl.sim.encounter import Encounter
    from ship_trl.sim.state import first_case

    if not len(states):
        sys.stdout.write("--write: nothing failed\n")
        return
    classes = describe_ships(states)[0][:, 0]
    cases = (
        replace(
            first_case(entry.suite, state), name=f"{path.stem}_{k}", ideal_path=Encounter(one).name.lower()
        )
        for k, (state, one) in enumerate(zip(states, classes, strict=True))
    )
    table = path.with_suffix(".csv")
    write_scenes(table, (Scene(case, math.nan, []) for case in cases))
    with atomic_write(path) as draft:
        draft.write_text(f"# {len(states)} scenes in which {entry.label} fails.\nscenes: {table.name}\n")
    sys.stdout.write(f"{path}\n{table}: {len(states)} scenes\n")


def write_scenes(path: Path, scenes: Iterable[Scene]) -> None:
    """Write a table of scenes. The class of encounter is the case's `ideal_path`."""
    from ship_trl.study.report.tables import write_csv

    rows = []
    for case, best_return, actions in scenes:
        numbers = [f"{number:.4f}" for ship in case.target_ships for number in astuple(ship)[:4]]
        numbers += [""] * (len(SHIP_COLUMNS) * MAX_SHIPS - len(numbers))
        known = "" if math.isnan(best_return) else f"{best_return:.3f}"
        cells = case.name, case.ideal_path, *numbers, known, "".join(map(str, actions))
        rows.append(dict(zip(TABLE_COLUMNS, cells, strict=True)))
    write_csv(path, rows)
