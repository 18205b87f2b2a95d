"""The report as one page of HTML that needs no other file."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import Any

import jinja2

from ship_trl.study.claims import describe_rules
from ship_trl.study.metrics import THRESHOLDS
from ship_trl.study.report.tables import EQUATION
from ship_trl.study.study import Study


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
