"""A study's report as a run of its wandb project: figures, tables, the page and the verdicts."""

from __future__ import annotations

import csv
import hashlib
import os
from pathlib import Path
from typing import Any, Literal

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import Logger, WandbMode
from ship_trl.study.plan.config import StudyConfig

REPORT = "report"
TABLES = ("claims", "arms", "table_2")


def check_account(config: StudyConfig) -> None:
    """Say at once, and not after hours, that nobody is logged in.

    Raises:
        ConfigError: wandb is to be online, and has no key.
    """
    if not config.logger.includes(Logger.wandb) or config.wandb.mode is not WandbMode.online:
        return
    os.environ.setdefault("WANDB_SILENT", "true")
    import wandb

    if not wandb.login(prompt=False, verify=False):
        raise ConfigError("wandb: nobody is logged in; `wandb login` does it; allowed: wandb.mode=offline")


def log_summary(config: StudyConfig) -> None:
    """Log the report, if the study is logged to wandb.

    Raises:
        ConfigError: wandb refuses.
    """
    if not config.logger.includes(Logger.wandb):
        return
    os.environ.setdefault("WANDB_SILENT", "true")
    import wandb

    folder = config.folder / REPORT
    mode: Literal["offline", "online"] = "online" if config.wandb.mode is WandbMode.online else "offline"
    tables = {name: read_table(folder / f"{name}.csv") for name in TABLES}
    try:
        with wandb.init(
            project=config.wandb.project,
            entity=config.wandb.entity,
            mode=mode,
            dir=str(config.folder),
            group=REPORT,
            job_type=REPORT,
            name=f"report of {config.folder.name}",
            # One and the same for a study, however often its report is made anew.
            id=f"{REPORT}-{hashlib.sha256(str(config.folder.absolute()).encode()).hexdigest()[:12]}",
            resume="allow",
            tags=[config.profile],
            config={"seeds": list(config.numbers), "pairs": config.pairs, "arms": config.arms},
            reinit="finish_previous",
        ) as run:
            logged: dict[str, Any] = {png.stem: wandb.Image(str(png)) for png in sorted(folder.glob("*.png"))}
            logged |= {
                name: wandb.Table(columns=list(rows[0]), data=rows[1:]) for name, rows in tables.items()
            }
            run.log(logged | {"page": wandb.Html(str(folder / "index.html"), inject=False)})
            run.summary.update(verdicts(tables["claims"]))
    except (wandb.Error, OSError) as error:
        raise ConfigError(
            f"wandb: {' '.join(str(error).split())}; wandb.mode=offline needs no account"
        ) from None


def read_table(path: Path) -> list[list[Any]]:
    """Rows of a CSV file, the heading first; a heading alone where there is no file."""
    if not path.exists():
        return [["nothing"]]
    with path.open(newline="") as file:
        heading, *rows = csv.reader(file)
    # A column of numbers is one: wandb sorts and plots it.
    columns = [numbers(list(column)) for column in zip(*rows, strict=True)]
    return [list(heading), *map(list, zip(*columns, strict=True))]


def numbers(column: list[str]) -> list[Any]:
    """Read a column as numbers, None where there is none; as it is if it holds words."""
    try:
        return [float(cell) if cell else None for cell in column]
    except ValueError:
        return list(column)


def verdicts(rows: list[list[Any]]) -> dict[str, str]:
    """Give the verdict on each claim, as "verdict/C1"."""
    found = [dict(zip(rows[0], row, strict=True)) for row in rows[1:]]
    return {f"verdict/{row['claim']}": row["claim's verdict"] for row in found}
