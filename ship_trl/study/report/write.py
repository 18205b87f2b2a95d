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
from matplotlib.figure import Figure

from ship_trl.config.errors import ConfigError
from ship_trl.files.disk import atomic_write
from ship_trl.run.console import Show, show_share
from ship_trl.study.claims import NO_CLAIMS, Claims, Verdicts, describe_rules
from ship_trl.study.metrics import THRESHOLDS
from ship_trl.study.report import tables
from ship_trl.study.report.curves import draw_differences, draw_pair, draw_reuse, draw_times
from ship_trl.study.report.gains import draw_forest, draw_gains, draw_layers
from ship_trl.study.report.style import NARROW, WIDE, as_png, pair_title, reuse_title, save
from ship_trl.study.report.tables import EQUATION
from ship_trl.study.study import Study, finished_study, pairs

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
            lines = write(study, folder, output, missing_runs(study, folder, seeds), show)
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


def missing_runs(study: Study, folder: Path, seeds: int | None = None) -> int:
    """Count the planned runs of the first `seeds` seeds, or of all, that are neither read nor broken."""
    shown = study.seeds[:seeds]
    planned = {job.folder(folder) for job in study.plan.jobs if seeds is None or job.seed in shown}
    found = {record.folder for record in study.records.values()} | {path for path, _ in study.broken}
    return len(planned - found)


def render(study: Study, **shown: Any) -> str:
    """Return the page.

    `shown` goes to the template as it is: `arms` and `similar` are rows of tables, `pictures` the figures,
    `missing` the number of planned runs without a result; the rest is what a page of claims shows.
    """
    page = study.claims.page or Path(__file__).parent / "page.html"
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader([Path(__file__).parent, page.parent]),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["isfinite"] = isfinite
    records = study.records.values()
    computed = study.computed()
    words = {
        key: f"{key}: {', '.join(f'{value} ({count})' for value, count in counts.items())}"
        for key, counts in computed.items()
    }
    return environment.get_template(page.name).render(
        shown,
        runs=len(records),
        profile=", ".join(sorted({r.profile for r in records})),
        episodes=", ".join(sorted({str(len(r.training.returns)) for r in records})),
        seeds=len({key[3] for key in study.records}),
        threshold=THRESHOLDS[0],
        rules=describe_rules(study.plan.rules, study.claims.rules),
        mixed=[words[key] for key, counts in computed.items() if len(counts) > 1],
        computed=list(words.values()),
        equation=EQUATION,
        broken=study.broken,
    )


# Names of figures. Files of an earlier report with these names are removed unless they are drawn again.
NAMES = (
    *("pair_*", "reuse", "differences", "times", "gains", "gains_greedy", "gains_forest", "layers"),
    "forest_*",
)
# Draws a figure of a width in inches; None if the study has no runs for it.
Draw = Callable[[float], Figure | None]


def drawings(study: Study) -> dict[str, tuple[str, Draw]]:
    """Return title and drawing function of each figure by its name, in the order of the page."""
    return {
        **{
            f"pair_{pair}": (pair_title(study, pair), partial(draw_pair, study, pair))
            for pair in pairs(study)
        },
        "reuse": (reuse_title(study), partial(draw_reuse, study)),
        "differences": ("Differences from scratch along the training", partial(draw_differences, study)),
        "times": ("Time to the threshold", partial(draw_times, study)),
        "gains": ("Gains of transfer, by source and target", partial(draw_gains, study, "area")),
        "gains_greedy": ("Gains of transfer in greedy returns", partial(draw_gains, study, "greedy area")),
        "gains_forest": ("Gains of the pairs in greedy returns", partial(draw_forest, study)),
        "layers": ("Similarity of layers", partial(draw_layers, study)),
    }


def draw_all(study: Study, output: Path, show: Callable[[float], None]) -> list[dict[str, str]]:
    """Draw all figures that the study has runs for, as PNG and PDF, and remove those of an earlier report.

    `show` is told the share of the figures that are done.

    Returns:
        For each figure its name, its title, and its PNGs for wide and narrow screens in base64.
    """
    pictures, written = [], set()
    planned = drawings(study)
    for done, (name, (title, draw)) in enumerate(planned.items()):
        show(done / len(planned))
        wide, narrow = draw(WIDE), draw(NARROW)
        if wide is None or narrow is None:
            continue
        paths = save(wide, output / name)
        written |= set(paths)
        forms = {"wide": paths[0].read_bytes(), "narrow": as_png(narrow)}
        encoded = {form: base64.b64encode(data).decode() for form, data in forms.items()}
        pictures.append({"name": name, "title": title} | encoded)
    for path in (path for name in NAMES for path in output.glob(f"{name}.*")):
        if path.suffix in (".png", ".pdf") and path not in written:
            path.unlink()
    return pictures
