"""The report of a study's folder: tables, figures and one page, from result files alone. No torch."""

from __future__ import annotations

import gc
import sys
from pathlib import Path

from ship_trl.config.errors import ConfigError
from ship_trl.files.disk import links, read_json, replacing
from ship_trl.study.analysis.contrasts import LEAST_SEEDS
from ship_trl.study.analysis.study import Study, finished_study
from ship_trl.study.claims.placebo import placebo
from ship_trl.study.claims.verdicts import answer, explore, reached
from ship_trl.study.plan.jobs import PAIRS, run_folder
from ship_trl.study.plan.manifest import PLAN, cases_of
from ship_trl.study.report import tables
from ship_trl.study.report.drawings import draw_all
from ship_trl.study.report.layers import layer_rows
from ship_trl.study.report.page import Earlier, as_markdown, render
from ship_trl.study.report.similarities import table_2

Seeds = tuple[int, ...] | None


def report(folder: Path, output: Path, earlier: Path | None = None, seeds: int | None = None) -> None:
    """Write the report of a study's folder: index.html, verdicts.md, CSV tables, figures as PNG and PDF.

    What cannot be read is named on stderr and on the page, and left out. Of an `earlier` study's claims.csv
    the verdicts are named beside. Of a study under way the first `seeds` may be shown alone.

    Raises:
        ConfigError: there is no finished run, the report cannot be written, the earlier table is none, or
            there are not so many seeds.
    """
    before = {} if earlier is None else tables.read_verdicts(earlier)
    if linked := links(output, folder):
        # In a stranger's study it could lead anywhere, and files of an earlier report are deleted.
        raise ConfigError(
            f"output: {linked[0]} is a link; allowed: --output with the folder that it leads to"
        )
    study = finished_study(folder, seeds)
    try:
        output.mkdir(parents=True, exist_ok=True)
        write(study, folder, output, before, None if seeds is None else study.seeds[:seeds])
    except OSError as error:
        raise ConfigError(f"output: {error.filename} cannot be written: {error.strerror}") from None
    # Figures and their parts refer to one another in circles, 8 MB a report, and `holm`, as it freezes what
    # there is, sets back the counts by which Python would find them.
    gc.collect()
    sys.stdout.write(f"{len(study.records)} runs, {len(study.broken)} left out; {output / 'index.html'}\n")


def write(study: Study, folder: Path, output: Path, earlier: Earlier, shown: Seeds) -> None:
    """Measure and write everything; what is missing is counted for the seeds `shown`, or for all."""
    answers, explored = answer(study), explore(study)
    arms, similar = tables.arm_rows(study), table_2()
    for name, rows in (
        ("runs", tables.run_rows(study)),
        ("arms", arms),
        ("claims", tables.claim_rows([*answers, *explored])),
        ("table_2", similar),
        ("transfers", tables.transfer_rows(study, cases_of(folder))),
        ("cka", layer_rows(study)),
    ):
        tables.write_csv(output / f"{name}.csv", rows)
    drawn = draw_all(study, [*answers, *explored], output)
    seeds = {key[3] for key in study.records if key[0] == PAIRS}
    looked = set(study.seeds[: reached(study)[-1]])
    shuffled = placebo(study) if len(seeds) >= LEAST_SEEDS else None
    lacking = missing(folder, study, shown)
    page = render(study, answers, explored, arms, similar, drawn, shuffled, lacking, earlier)
    for name, text in (("index.html", page), ("verdicts.md", as_markdown(answers, earlier))):
        with replacing(output / name) as draft:
            draft.write_text(text)
    for found in answers:
        if found.findings:
            sys.stdout.write(f"{found.hypothesis.name:<3}  {found.word:<13} {found.hypothesis.sentence}\n")
    if without := [found.hypothesis.name for found in answers if not found.findings]:
        sys.stdout.write(f"no runs: {', '.join(without)}\n")
    if between := sorted(seeds & set(study.seeds) - looked):
        sys.stdout.write(
            f"Claims are those of the look after {len(looked)} seeds; figures and arms.csv have "
            f"{len(between)} more, which the next look judges.\n"
        )
    if lacking:
        sys.stdout.write(f"{lacking} planned runs are missing\n")
    if shuffled is None:
        sys.stdout.write(f"fewer than {LEAST_SEEDS} seeds: no verdict is possible but inconclusive\n")


def missing(folder: Path, study: Study, shown: Seeds = None) -> int:
    """How many runs the study planned, of some seeds or all, that are neither there nor named as broken."""
    try:
        jobs = read_json(folder / PLAN)["jobs"]
        planned = {
            run_folder(folder, j["part"], j["label"], j["arm"], j["seed"])
            for j in jobs
            if shown is None or j["seed"] in shown
        }
    except (OSError, ValueError, KeyError, TypeError):
        return 0
    found = {record.folder for record in study.records.values()} | {path for path, _ in study.broken}
    return len(planned - found)
