"""`python -m ship_trl.report FOLDER`: the report of a study, from its result files alone. No torch."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from ship_trl.cli import complain
from ship_trl.paths import replacing

CAPTION = "Mean over seeds, moving over a twentieth of the episodes; the band is one standard deviation."


def main(arguments: list[str] | None = None) -> None:
    """Read the runs, measure the claims, write tables, figures and page."""
    parser = argparse.ArgumentParser(prog="python -m ship_trl.report", description=__doc__)
    parser.add_argument("folder", type=Path, help="of a study, as outputs/quick_study")
    parser.add_argument("--output", type=Path, help="where the report goes; default: FOLDER/report")
    options = parser.parse_args(arguments)
    if not options.folder.is_dir():
        complain(f"folder: no folder {options.folder}; python -m ship_trl.study makes one")
        sys.exit(1)
    try:
        report(options.folder, options.output or options.folder / "report")
    except OSError as error:
        complain(f"output: {error.filename} cannot be written: {error.strerror}")
        sys.exit(1)


def report(folder: Path, output: Path) -> None:
    """Write the report of a study's folder."""
    from ship_trl.study import figures, tables
    from ship_trl.study.answers import answer
    from ship_trl.study.measured import read_study
    from ship_trl.study.page import render

    study = read_study(folder)
    for path, reason in study.broken:
        complain(f"{path}: {reason}; left out")
    if not study.records:
        complain(f"folder: no finished run below {folder}; python -m ship_trl.study makes some")
        sys.exit(1)
    output.mkdir(parents=True, exist_ok=True)
    answers, arms = answer(study), tables.arm_rows(study)
    tables.write_csv(output / "runs.csv", tables.run_rows(study))
    tables.write_csv(output / "arms.csv", arms)
    tables.write_csv(output / "claims.csv", tables.claim_rows(answers))
    drawn = []
    for name, title, figure in (
        *((f"pair_{pair}", f"Pair {pair}", figures.draw_pair(study, pair)) for pair in figures.NUMBERS),
        ("reuse", "Reuse on the new case", figures.draw_reuse(study)),
        ("gains", "What transfer gains", figures.draw_gains(study)),
    ):
        if figure is not None:
            png, _ = figures.save(figure, output / name)
            drawn.append((title, "" if name == "gains" else CAPTION, png))
    page = render(study, answers, arms, drawn, missing(folder, len(study.records)))
    with replacing(output / "index.html") as draft:
        draft.write_text(page)
    for found in answers:
        sys.stdout.write(f"{found.hypothesis.name}  {found.verdict.value:<13} {found.hypothesis.sentence}\n")
    sys.stdout.write(f"{len(study.records)} runs, {len(study.broken)} left out; {output / 'index.html'}\n")


def missing(folder: Path, found: int) -> int:
    """How many runs the study planned and has not."""
    try:
        planned = len(json.loads((folder / "study.json").read_text())["jobs"])
    except (OSError, ValueError, KeyError, TypeError):
        return 0
    return max(0, planned - found)


if __name__ == "__main__":
    main()
