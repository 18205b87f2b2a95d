"""Write the report of a study: tables, figures and page. No torch."""

from __future__ import annotations

import gc
import sys
from pathlib import Path

from ship_trl.config.errors import ConfigError
from ship_trl.files.disk import atomic_write
from ship_trl.run.console import Show, show_share
from ship_trl.study.claims import NO_CLAIMS, Claims, Verdicts
from ship_trl.study.report import tables
from ship_trl.study.report.figures import draw_all
from ship_trl.study.report.page import render
from ship_trl.study.study import Study, finished_study

# Shares of the time that pass until runs are read, claims are judged and tables are written; then figures.
READ, JUDGED, TABLES = 0.1, 0.2, 0.5


def report(folder: Path, output: Path, seeds: int | None = None, claims: Claims = NO_CLAIMS) -> None:
    """Write the page, tables and figures of a study or its tables, or of its first seeds, with its verdicts.

    Runs that cannot be read are left out, and named on stderr and on the page.

    Raises:
        ConfigError: there is no finished run, there are fewer seeds, the report cannot be written, or
            the claims cannot be judged.
    """
    with show_share("report") as show:
        study = finished_study(folder, seeds, claims)
        try:
            output.mkdir(parents=True, exist_ok=True)
            lines = write(study, folder, output, missing_runs(study, seeds), show)
        except OSError as error:
            raise ConfigError(f"output: {error.filename} cannot be written: {error.strerror}") from None
    # Figures hold reference cycles, 8 MB a report.
    gc.collect()
    lines.append(f"{len(study.records)} runs, {len(study.broken)} left out; {output / 'index.html'}")
    sys.stdout.write("".join(f"{line}\n" for line in lines))


def write(study: Study, folder: Path, output: Path, missing: int, show: Show) -> list[str]:
    """Judge the claims, write all files, and return what is to be printed."""
    show(READ)
    judge = study.claims.judge
    judged = Verdicts([], "", [], {}) if judge is None else judge(study, folder)
    show(JUDGED)
    arms = tables.arm_rows(study)
    rows = {
        "runs": tables.run_rows(study),
        "arms": tables.as_kept(arms),
        "claims": judged.rows,
        "table_2": tables.similarity_rows(study.claims),
        "transfers": tables.transfer_rows(study),
        "cka": tables.layer_rows(study),
    }
    for name, table in rows.items():
        tables.write_csv(output / f"{name}.csv", table)
    show(TABLES)
    has_forgetting = any("forgetting" in row for row in arms)
    shown = {"arms": arms, "has_forgetting": has_forgetting, "similar": rows["table_2"], "missing": missing}
    pictures = draw_all(study, output, lambda share: show(TABLES + (1 - TABLES) * share))
    page = render(study, pictures=pictures, **shown, **judged.shown)
    for name, text in (("index.html", page), ("verdicts.md", judged.markdown)):
        if not text:
            (output / name).unlink(missing_ok=True)
            continue
        with atomic_write(output / name) as draft:
            draft.write_text(text)
    return [*judged.lines, *([f"{missing} planned runs are missing"] if missing else [])]


def missing_runs(study: Study, seeds: int | None = None) -> int:
    """Count the planned runs of the first `seeds` seeds, or of all, that are neither read nor broken."""
    shown = set(study.seeds[:seeds]) if seeds is not None else set(study.plan.folders.values())
    planned = {folder for folder, seed in study.plan.folders.items() if seed in shown}
    found = {record.folder for record in study.records.values()} | {path for path, _ in study.broken}
    return len(planned - found)
