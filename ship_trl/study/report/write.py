"""Writes the report of a study's folder: tables, figures and page. No torch."""

from __future__ import annotations

import gc
import sys
from pathlib import Path

from ship_trl.config.errors import ConfigError
from ship_trl.files.disk import atomic_write, links
from ship_trl.study.analysis.contrasts import MIN_SEEDS
from ship_trl.study.analysis.study import Study, finished_study
from ship_trl.study.claims.verdicts import answer, explore
from ship_trl.study.plan.jobs import PAIRS
from ship_trl.study.report import tables
from ship_trl.study.report.figures import draw_all
from ship_trl.study.report.page import Earlier, as_markdown, render

# The claims.csv of an earlier study's report, which may lie in a study's folder: its verdicts are named, too.
EARLIER = "earlier.csv"


def report(folder: Path, output: Path, seeds: int | None = None) -> None:
    """Write index.html, verdicts.md, CSV tables, and figures as PNG and PDF.

    Runs that cannot be read are left out, and named on stderr and on the page.

    Args:
        folder: of a study, or of its tables.
        output: where the report goes.
        seeds: use only this many of the first seeds.

    Raises:
        ConfigError: there is no finished run, there are fewer seeds, the report cannot be written, or
            the verdicts of the earlier study cannot be read.
    """
    path = folder / EARLIER
    earlier = tables.read_verdicts(path) if path.exists() else {}
    if linked := links(output, folder):
        # A link in an untrusted study could lead anywhere, and files of an earlier report are removed.
        raise ConfigError(
            f"output: {linked[0]} is a link; allowed: --output with the folder that it leads to"
        )
    study = finished_study(folder, seeds)
    try:
        output.mkdir(parents=True, exist_ok=True)
        write(study, output, earlier, missing_runs(study, seeds))
    except OSError as error:
        raise ConfigError(f"output: {error.filename} cannot be written: {error.strerror}") from None
    # Figures hold reference cycles, 8 MB a report, and `holm` resets the counts that would start a
    # collection.
    gc.collect()
    sys.stdout.write(f"{len(study.records)} runs, {len(study.broken)} left out; {output / 'index.html'}\n")


def write(study: Study, output: Path, earlier: Earlier, missing: int) -> None:
    """Measure and write everything, and print the verdicts."""
    answers, explored = answer(study), explore(study)
    arms, similar = tables.arm_rows(study), tables.similarity_rows()
    for name, rows in (
        ("runs", tables.run_rows(study)),
        ("arms", arms),
        ("claims", tables.claim_rows([*answers, *explored])),
        ("table_2", similar),
        ("transfers", tables.transfer_rows(study)),
        ("cka", tables.layer_rows(study)),
    ):
        tables.write_csv(output / f"{name}.csv", rows)
    pictures = draw_all(study, output)
    page = render(study, answers, explored, arms, similar, pictures, missing, earlier)
    verdicts = as_markdown(answers, earlier, len(study.looks))
    for name, text in (("index.html", page), ("verdicts.md", verdicts)):
        with atomic_write(output / name) as draft:
            draft.write_text(text)
    for found in answers:
        if found.findings:
            sys.stdout.write(f"{found.hypothesis.name:<3}  {found.word:<13} {found.hypothesis.sentence}\n")
    if without := [found.hypothesis.name for found in answers if not found.findings]:
        sys.stdout.write(f"no runs: {', '.join(without)}\n")
    seeds = {key[3] for key in study.records if key[0] == PAIRS}
    judged = set(study.seeds[: study.whole_looks[-1]])
    if later := sorted(seeds & set(study.seeds) - judged):
        sys.stdout.write(
            f"Claims are those of the look after {len(judged)} seeds; figures and arms.csv have "
            f"{len(later)} more, which the next look judges.\n"
        )
    if missing:
        sys.stdout.write(f"{missing} planned runs are missing\n")
    if len(seeds) < MIN_SEEDS:
        sys.stdout.write(f"fewer than {MIN_SEEDS} seeds: no verdict is possible but inconclusive\n")


def missing_runs(study: Study, seeds: int | None = None) -> int:
    """Count the planned runs of the first `seeds` seeds, or of all, that are neither there nor broken."""
    shown = set(study.seeds[:seeds]) if seeds is not None else set(study.plan.folders.values())
    planned = {folder for folder, seed in study.plan.folders.items() if seed in shown}
    found = {record.folder for record in study.records.values()} | {path for path, _ in study.broken}
    return len(planned - found)
