"""Writes a study's report from its runs or their tables: CSV files, figures and one page. No torch."""

from __future__ import annotations

import base64
import gc
import sys
from collections.abc import Callable
from functools import partial
from math import isfinite
from pathlib import Path
from typing import Any

import jinja2
import matplotlib
from matplotlib.figure import Figure

from ship_trl.config.errors import ConfigError, command, counted
from ship_trl.files.disk import atomic_write
from ship_trl.run.console import Show, show_share
from ship_trl.study.claims import NO_CLAIMS, Verdicts, load_claims
from ship_trl.study.manifest import describe_rules, load_plan
from ship_trl.study.metrics import LATER, THRESHOLDS
from ship_trl.study.report import curves, encounters, gains, opening, tables
from ship_trl.study.report.style import REPORT, WIDTH, save
from ship_trl.study.study import Study, finished_study, pairs

# Shares of the time that pass until runs are read, claims are judged and tables are written; then figures.
READ, JUDGED, TABLES = 0.1, 0.2, 0.5


def report(folder: Path, output: Path, seeds: int | None = None, claims: Path | None = None) -> None:
    """Write the page, tables and figures of a study or its tables, or of its first seeds.

    There are verdicts if the study was begun with rules, or a `claims` file is named. Runs that cannot be
    read are left out, and named on stderr and on the page.

    Raises:
        ConfigError: there is no finished run, there are fewer seeds, the report cannot be written, or
            the claims cannot be judged.
    """
    with show_share("report") as show:
        is_judged = claims is not None or load_plan(folder).rules
        study = finished_study(folder, seeds, load_claims(claims) if is_judged else NO_CLAIMS)
        try:
            output.mkdir(parents=True, exist_ok=True)
            lines = write(study, folder, output, missing_runs(study, folder, seeds), show)
        except OSError as error:
            raise ConfigError(f"output: {error.filename} cannot be written: {error.strerror}") from None
    # Figures hold reference cycles, 8 MB a report.
    gc.collect()
    runs = counted(len(study.records), "run")
    lines.append(f"{runs}, {len(study.broken)} left out; {output / 'index.html'}")
    sys.stdout.write("".join(f"{line}\n" for line in lines))


def missing_runs(study: Study, folder: Path, seeds: int | None) -> int:
    """Count the planned runs of the first `seeds` seeds, or of all, that are neither read nor broken."""
    shown = study.seeds[:seeds]
    planned = {job.folder(folder) for job in study.plan.jobs if seeds is None or job.seed in shown}
    found = {record.folder for record in study.records.values()} | {path for path, _ in study.broken}
    return len(planned - found)


def write(study: Study, folder: Path, output: Path, missing: int, show: Show) -> list[str]:
    """Judge the claims, write all files, and return what is to be printed."""
    show(READ)
    judge = study.claims.judge
    judged = Verdicts([], [], {}) if judge is None else judge(study, folder)
    show(JUDGED)
    reached = list(opening.measure_arms(study))
    headlines = [one.headline for one in reached if one.differences]
    arms = tables.arm_rows(study)
    # Tables of older studies stay as they were, see `LATER`.
    is_old = bool(arms) and LATER[0] not in arms[0]
    kept = [{k: v for k, v in row.items() if not (is_old and k.startswith(tables.FORWARD))} for row in arms]
    rows = {
        "runs": tables.run_rows(study),
        "arms": kept,
        "effects": [] if study.claims.judge else [one.row for one in reached],
        "claims": judged.rows,
        "table_2": tables.similarity_rows(study),
        "transfers": tables.transfer_rows(study),
        "cka": tables.layer_rows(study),
    }
    for name, table in rows.items():
        tables.write_csv(output / f"{name}.csv", table)
    show(TABLES)
    records, facts, words = study.records.values(), opening.facts_of(study), study.plan.words
    page = study.claims.page or Path(__file__).parent / "page.html"
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader([Path(__file__).parent, page.parent]),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(isfinite=isfinite, counted=counted)
    text = environment.get_template(page.name).render(
        judged.shown,
        title=opening.title_of(study),
        headlines=headlines if len(headlines) <= opening.MANY else [],
        reached=reached,
        outcomes=opening.OUTCOMES,
        facts=facts,
        # An older plan keeps no words.
        command=command("study", "run", *words, "output=outputs/again") if words else "",
        is_judged=study.claims.judge is not None,
        arms=arms,
        has_forgetting=any("forgetting" in row for row in arms),
        is_never=bool(arms) and all(row["reached"] == 0 for row in arms),
        similar=rows["table_2"],
        missing=missing,
        pictures=draw_all(study, output, lambda share: show(TABLES + (1 - TABLES) * share)),
        runs=len(records),
        profile=", ".join(sorted({r.profile for r in records})),
        episodes=", ".join(sorted({str(r.episodes) for r in records})),
        seeds=len({key[3] for key in study.records}),
        threshold=THRESHOLDS[0],
        rules=describe_rules(study.plan.rules, study.claims.rules),
        mixed=[f"{key}: {facts[key]}" for key, counts in study.computed().items() if len(counts) > 1],
        equation=tables.EQUATION,
        broken=study.broken,
    )
    with atomic_write(output / "index.html") as draft:
        draft.write_text(text)
    told = [] if study.claims.judge else headlines[: opening.MANY]
    return [*judged.lines, *told, *([f"missing: {counted(missing, 'planned run')}"] if missing else [])]


# Names of figures. Files of an earlier report with these names are removed unless they are drawn again.
NAMES = ("cases", "effects", "pair_*", "reuse", "differences", "times", "gains*", "layers", "forest_*")


def drawings(study: Study) -> dict[str, tuple[str, Callable[[], Figure | None]]]:
    """Return title and drawing function of each figure by its name, in the order of the page.

    A function returns None if the study has no runs for its figure. Few arms without claims need no maps.
    """
    sections = {pair: curves.pair_sections(study, pair) for pair in pairs(study)}
    # Figures of scores.
    scored = study.scored()
    is_small = (
        bool(sections) and not study.claims.judge and all(curves.few_arms(study, pair) for pair in sections)
    )
    cases = {"cases": ("The encounters", lambda: encounters.draw_cases(study))}
    effects = {"effects": ("Greedy return above scratch", lambda: gains.draw_effects(study))}
    maps = {
        "gains": ("Gains of transfer, by source and target", lambda: gains.draw_gains(scored, "area")),
        "gains_greedy": (
            "Gains of transfer in greedy returns",
            lambda: gains.draw_gains(scored, "greedy area"),
        ),
        "gains_forest": ("Gains of the pairs in greedy returns", lambda: gains.draw_forest(scored)),
    }
    return {
        **({} if study.claims.judge else cases),
        **(effects if is_small else {}),
        **{
            f"pair_{pair}": (curves.pair_title(study, pair), partial(curves.draw_returns, study, shown))
            for pair, shown in sections.items()
        },
        "reuse": (
            curves.reuse_title(study),
            lambda: curves.draw_returns(study, curves.reuse_sections(study)),
        ),
        "differences": (
            "Differences from scratch along the training",
            lambda: curves.draw_differences(scored),
        ),
        "times": ("Time to the threshold", lambda: curves.draw_times(scored)),
        **({} if is_small else maps),
        "layers": ("Similarity of layers", lambda: gains.draw_layers(study)),
    }


def draw_all(study: Study, output: Path, show: Callable[[float], None]) -> list[dict[str, Any]]:
    """Draw all figures that the study has runs for, as PNG and PDF, and remove those of an earlier report.

    `show` is told the share of the figures that are done.

    Returns:
        For each figure its name, its title, its PNG in base64, and whether it is `narrow`.
    """
    pictures, planned = [], drawings(study)
    with matplotlib.rc_context(REPORT):
        for done, (name, (title, draw)) in enumerate(planned.items()):
            show(done / len(planned))
            if figure := draw():
                png = save(figure, output / name)
                narrow = figure.get_figwidth() < WIDTH
                code = base64.b64encode(png).decode()
                pictures.append({"name": name, "title": title, "png": code, "narrow": narrow})
    drawn = {picture["name"] for picture in pictures}
    for path in (path for name in NAMES for path in output.glob(f"{name}.*")):
        if path.suffix in (".png", ".pdf") and path.stem not in drawn:
            path.unlink()
    return pictures
