"""Write the report of a study: tables, figures and page. No torch."""

from __future__ import annotations

import gc
import sys
from pathlib import Path

from ship_trl.config.errors import ConfigError
from ship_trl.files.disk import atomic_write, links
from ship_trl.study.analysis.contrasts import MIN_SEEDS
from ship_trl.study.analysis.study import Study, finished_study
from ship_trl.study.claims.grades import grade_all
from ship_trl.study.claims.verdicts import answer, explore
from ship_trl.study.plan.jobs import PAIRS
from ship_trl.study.report import tables
from ship_trl.study.report.figures import draw_all
from ship_trl.study.report.page import Earlier, as_markdown, describe_grades, render

# A copy of the claims.csv of an earlier study in a study's folder: its verdicts are named too.
EARLIER = "earlier.csv"


def report(folder: Path, output: Path, seeds: int | None = None) -> None:
    """Write index.html, verdicts.md, CSV tables, and figures of a study or its tables, or of its first seeds.

    Runs that cannot be read are left out, and named on stderr and on the page.

    Raises:
        ConfigError: there is no finished run, there are fewer seeds, the report cannot be written, or
            the verdicts of the earlier study cannot be read.
    """
    path = folder / EARLIER
    earlier = tables.read_verdicts(path) if path.exists() else {}
    if linked := links(output, folder):
        # A link in an untrusted study could lead anywhere, and files of an earlier report are removed.
        raise ConfigError(f"output: {linked[0]} is a link; allowed: --output with the folder it points to")
    study = finished_study(folder, seeds)
    try:
        output.mkdir(parents=True, exist_ok=True)
        write(study, output, earlier, missing_runs(study, seeds))
    except OSError as error:
        raise ConfigError(f"output: {error.filename} cannot be written: {error.strerror}") from None
    # Figures hold reference cycles, 8 MB a report.
    gc.collect()
    say(f"{len(study.records)} runs, {len(study.broken)} left out; {output / 'index.html'}")


def say(line: str) -> None:
    """Print a line."""
    sys.stdout.write(f"{line}\n")


def write(study: Study, output: Path, earlier: Earlier, missing: int) -> None:
    """Judge and grade the claims, write all files, and print verdicts and grades."""
    answers, explored, arms = answer(study), explore(study), tables.arm_rows(study)
    grades = grade_all(study)
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
    has_forgetting = any("forgetting" in row for row in arms)
    shown = {"arms": arms, "has_forgetting": has_forgetting, "similar": rows["table_2"], "missing": missing}
    page = render(study, answers, explored, grades, earlier, pictures=draw_all(study, output), **shown)
    verdicts = as_markdown(answers, grades, earlier, len(study.looks))
    for name, text in (("index.html", page), ("verdicts.md", verdicts)):
        with atomic_write(output / name) as draft:
            draft.write_text(text)
    for found in answers:
        if found.findings:
            graded = grades[found.hypothesis.name].grade
            say(f"{found.hypothesis.name:<3}  {found.word:<13} {graded:<15} {found.hypothesis.sentence}")
    if without := [found.hypothesis.name for found in answers if not found.findings]:
        say(f"no runs: {', '.join(without)}")
    say(describe_grades(grades))
    seeds = {key[3] for key in study.records if key[0] == PAIRS}
    judged = set(study.seeds[: study.whole_looks[-1]])
    if later := seeds & set(study.seeds) - judged:
        say(
            f"Claims are those of the look after {len(judged)} seeds; figures and arms.csv have "
            f"{len(later)} more, which the next look judges."
        )
    if missing:
        say(f"{missing} planned runs are missing")
    if len(seeds) < MIN_SEEDS:
        say(f"fewer than {MIN_SEEDS} seeds: every verdict is inconclusive")


def missing_runs(study: Study, seeds: int | None = None) -> int:
    """Count the planned runs of the first `seeds` seeds, or of all, that are neither read nor broken."""
    shown = set(study.seeds[:seeds]) if seeds is not None else set(study.plan.folders.values())
    planned = {folder for folder, seed in study.plan.folders.items() if seed in shown}
    found = {record.folder for record in study.records.values()} | {path for path, _ in study.broken}
    return len(planned - found)
