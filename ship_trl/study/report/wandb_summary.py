"""A study's report as a run of its wandb project: figures, tables, page and verdicts."""

from __future__ import annotations

import hashlib
import os
from typing import Any

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import WandbMode, trackers_of
from ship_trl.study.plan import StudyConfig

REPORT = "report"
TABLES = ("claims", "arms", "table_2")


def check_account(config: StudyConfig) -> None:
    """Check that a user is logged in to wandb before hours of training begin.

    Raises:
        ConfigError: wandb is to be online, and has no key.
    """
    if "wandb" not in trackers_of(config.logger):
        return
    os.environ.setdefault("WANDB_SILENT", "true")
    import wandb

    if config.wandb.mode is WandbMode.online and not wandb.login(prompt=False, verify=False):
        raise ConfigError("wandb: not logged in; run `wandb login`; allowed: wandb.mode=offline")


def log_summary(config: StudyConfig) -> None:
    """Log the report, if the study is logged to wandb.

    Raises:
        ConfigError: wandb refuses.
    """
    if "wandb" not in trackers_of(config.logger):
        return
    import pandas as pd
    import wandb

    folder = config.folder / REPORT
    logged: dict[str, Any] = {png.stem: wandb.Image(str(png)) for png in sorted(folder.glob("*.png"))}
    logged["page"] = wandb.Html(str(folder / "index.html"), inject=False)
    for name in TABLES:
        if (path := folder / f"{name}.csv").exists():
            logged[name] = wandb.Table(dataframe=pd.read_csv(path))
    verdicts = {}
    if (path := folder / "claims.csv").exists():
        verdicts = pd.read_csv(path).groupby("claim")["claim's verdict"].first().to_dict()
    # A later report of the study replaces this one, because it has the same id.
    digest = hashlib.sha256(str(config.folder.absolute()).encode()).hexdigest()[:12]
    try:
        with wandb.init(
            project=config.wandb.project,
            entity=config.wandb.entity,
            mode="online" if config.wandb.mode is WandbMode.online else "offline",
            dir=str(config.folder),
            group=REPORT,
            job_type=REPORT,
            name=f"report of {config.folder.name}",
            id=f"{REPORT}-{digest}",
            resume="allow",
            tags=[config.profile],
            config={"seeds": list(config.numbers), "pairs": config.pairs, "arms": config.arms},
            reinit="finish_previous",
        ) as run:
            run.log(logged)
            run.summary.update({f"verdict/{name}": verdict for name, verdict in verdicts.items()})
    except (wandb.Error, OSError) as error:
        raise ConfigError(
            f"wandb: {' '.join(str(error).split())}; wandb.mode=offline needs no account"
        ) from None
