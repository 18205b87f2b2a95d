"""Write the report of a study: tables, figures and page. No torch."""

from __future__ import annotations

import gc
import sys
from pathlib import Path

from ship_trl.config.errors import ConfigError
from ship_trl.files.disk import atomic_write
from ship_trl.run.console import Show, show_share
from ship_trl.study.claims.grades import grade_all
from ship_trl.study.claims.verdicts import answer, explore
from ship_trl.study.compare import MIN_SEEDS
from ship_trl.study.plan import PAIRS
from ship_trl.study.report import tables
from ship_trl.study.report.figures import draw_all
from ship_trl.study.report.page import Earlier, as_markdown, describe_grades, render
from ship_trl.study.study import Study, finished_study

# A copy of the claims.csv of an earlier study in a study's folder: its verdicts are named too.
EARLIER = "earlier.csv"
# Shares of the time that pass until runs are read, claims are judged and tables are written; then figures.
READ, JUDGED, TABLES = 0.1, 0.2, 0.5


def report(folder: Path, output: Path, seeds: int | None = None) -> None:
    """Write index.html, verdicts.md, CSV tables, and figures of a study or its tables, or of its first seeds.

    Runs that cannot be read are left out, and named on stderr and on the page.

    Raises:
        ConfigError: there is no finished run, there are fewer seeds, the report cannot be written, or
            the verdicts of the earlier study cannot be read.
    """
    path = folder / EARLIER
    earlier = tables.read_verdicts(path) if path.exists() else {}
    with show_share("report") as show:
        study = finished_study(folder, seeds)
        try:
            output.mkdir(parents=True, exist_ok=True)
            lines = write(study, output, earlier, missing_runs(study, seeds), show)
        except OSError as error:
            raise ConfigError(f"output: {error.filename} cannot be written: {error.strerror}") from None
    # Figures hold reference cycles, 8 MB a report.
    gc.collect()
    lines.append(f"{len(study.records)} runs, {len(study.broken)} left out; {output / 'index.html'}")
    sys.stdout.write("".join(f"{line}\n" for line in lines))


def write(study: Study, output: Path, earlier: Earlier, missing: int, show: Show) -> list[str]:
    """Judge and grade the claims, write all files, and return lines with verdicts and grades."""
    show(READ)
    answers, explored = answer(study), explore(study)
    show(JUDGED)
    arms, grades = tables.arm_rows(study), grade_all(study)
    rows = {
        "runs": tables.run_rows(study),
        "arms": tables.as_kept(arms),
        "claims": tables.claim_rows([*answers, *explored], grades),
        "table_2": tables.similarity_rows(),
        "transfers": tables.transfer_rows(study),
        "cka": tables.layer_rows(study),
    }
    for name, table in rows.items():
        tables.write_csv(output / f"{name}.csv", table)
    show(TABLES)
    has_forgetting = any("forgetting" in row for row in arms)
    shown = {"arms": arms, "has_forgetting": has_forgetting, "similar": rows["table_2"], "missing": missing}
    pictures = draw_all(study, output, lambda share: show(TABLES + (1 - TABLES) * share))
    page = render(study, answers, explored, grades, earlier, pictures=pictures, **shown)
    verdicts = as_markdown(answers, grades, earlier, len(study.looks))
    for name, text in (("index.html", page), ("verdicts.md", verdicts)):
        with atomic_write(output / name) as draft:
            draft.write_text(text)
    lines = [
        f"{one.hypothesis.name:<3}  {one.word:<13} {grades[one.hypothesis.name].grade:<15} "
        f"{one.hypothesis.sentence}"
        for one in answers
        if one.findings
    ]
    if without := [found.hypothesis.name for found in answers if not found.findings]:
        lines.append(f"no runs: {', '.join(without)}")
    lines.append(describe_grades(grades))
    seeds = {key[3] for key in study.records if key[0] == PAIRS}
    judged = set(study.seeds[: study.whole_looks[-1]])
    if later := seeds & set(study.seeds) - judged:
        lines.append(
            f"Claims are those of the look after {len(judged)} seeds; figures and arms.csv have "
            f"{len(later)} more, which the next look judges."
        )
    if missing:
        lines.append(f"{missing} planned runs are missing")
    if len(seeds) < MIN_SEEDS:
        lines.append(f"fewer than {MIN_SEEDS} seeds: every verdict is inconclusive")
    return lines


def missing_runs(study: Study, seeds: int | None = None) -> int:
    """Count the planned runs of the first `seeds` seeds, or of all, that are neither read nor broken."""
    shown = set(study.seeds[:seeds]) if seeds is not None else set(study.plan.folders.values())
    planned = {folder for folder, seed in study.plan.folders.items() if seed in shown}
    found = {record.folder for record in study.records.values()} | {path for path, _ in study.broken}
    return len(planned - found)
