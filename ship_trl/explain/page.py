"""The page: one HTML file with all figures and tables. `page.html` holds the captions."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple, TypeVar

import jinja2
import numpy as np

from ship_trl.explain.bootstrap import Estimate
from ship_trl.explain.networks import Origin
from ship_trl.explain.rows import CKARow, ErasedRow, FilterRow, Measured, ProbeRow, Role
from ship_trl.explain.states import StateSet
from ship_trl.policies.entry import Entry

MISSING = "-"
Row = TypeVar("Row")


class Table(NamedTuple):
    """A table; the first `labels` columns are text, the others numbers."""

    head: list[str]
    rows: list[list[str]]
    labels: int


def make_table(columns: dict[str, Callable[[Row], str]], rows: Iterable[Row], labels: int = 1) -> Table:
    """Make a table of formatted columns, a line for each row."""
    return Table(list(columns), [[cell(row) for cell in columns.values()] for row in rows], labels)


def number(found: Estimate | None, digits: int = 2) -> str:
    """Format an estimate with its interval."""
    if found is None:
        return MISSING
    value, low, high = (f"{one:z.{digits}f}" for one in found)
    return f"{value} ({low} to {high})"


def share(found: Estimate) -> str:
    """Format a share with its interval."""
    return f"{found.value:.0%} ({found.low:.0%} to {found.high:.0%})"


def sign(found: Estimate | None) -> int:
    """Return 1 if the interval is above zero, -1 if it is below, else 0."""
    return 0 if found is None else int(found.low > 0) - int(found.high < 0)


def difference(found: Estimate | None) -> str:
    """Format a difference, with a mark if its interval excludes zero."""
    return number(found) + ("", " ▲", " ▼")[sign(found)]


def count_signs(found: list[Estimate | None]) -> str:
    """Count the differences whose interval excludes zero."""
    signs = list(map(sign, found))
    return f"{signs.count(1)} ▲ {signs.count(-1)} ▼"


def mean_r2(rows: list[ProbeRow]) -> str:
    """Average R² over probes."""
    return f"{np.mean([row.r2.value for row in rows]):.2f}"


def cka_range(rows: list[CKARow]) -> str:
    """Format the range of CKA over pairs of networks."""
    values = [row.cka.value for row in rows]
    return f"{min(values):.3f} to {max(values):.3f}" if values else MISSING


PROBES: dict[str, Callable[[ProbeRow], str]] = {
    "quantity": lambda row: row.quantity,
    "layer": lambda row: row.layer,
    "R²": lambda row: number(row.r2),
    "over pixels": lambda row: difference(row.over_pixels),
    "over untrained": lambda row: difference(row.over_untrained),
    "R², shuffled labels": lambda row: f"{row.shuffled_r2:.2f}",
}
ERASED: dict[str, Callable[[ErasedRow], str]] = {
    "thing": lambda row: row.thing,
    "network": lambda row: row.network,
    "states": lambda row: str(row.states),
    "action changes": lambda row: share(row.changed),
    "over untrained": lambda row: difference(row.over_untrained),
}
FILTERS: dict[str, Callable[[FilterRow], str]] = {
    "network": lambda row: row.network,
    "correlation of neighbouring weights": lambda row: number(row.neighbours),
}


def make_tables(measured: Measured) -> dict[str, Table]:
    """Make every table, by the name that `page.html` uses."""
    name, probes, erased = measured.explained.name, measured.explained_probes, measured.erased

    def of(layer: str) -> list[ProbeRow]:
        return [row for row in probes if row.layer == layer]

    def untrained(layer: str) -> list[ProbeRow]:
        return [row for row in measured.probes if row.layer == layer and row.role == Role.untrained]

    def cka(first: Role, second: Role) -> Callable[[str], str]:
        return lambda layer: "".join(number(row.cka, 3) for row in measured.cka_between(first, second, layer))

    by_layer: dict[str, Callable[[str], str]] = {
        "layer": str,
        "mean R²": lambda layer: mean_r2(of(layer)),
        "untrained": lambda layer: mean_r2(untrained(layer)),
        "quantities over untrained": lambda layer: count_signs([row.over_untrained for row in of(layer)]),
        "quantities over pixels": lambda layer: count_signs([row.over_pixels for row in of(layer)]),
    }
    change: dict[str, Callable[[str], str]] = {
        "layer": str,
        "source, before training": cka(Role.source, Role.before),
        "before, after training": cka(Role.before, Role.explained),
        "source, after training": cka(Role.source, Role.explained),
        "different seeds": lambda layer: cka_range(measured.cka_between_seeds(layer)),
        "after training, untrained": lambda layer: cka_range(
            measured.cka_between(Role.explained, Role.untrained, layer)
        ),
    }
    return {
        "best": make_table(PROBES, measured.best_probes(), labels=2),
        "probes": make_table(PROBES, probes, labels=2),
        "layers": make_table(by_layer, measured.layers),
        "cka": make_table(change, measured.layers),
        "erased": make_table(ERASED, (row for row in erased if row.network == name), labels=2),
        "erased_all": make_table(ERASED, erased, labels=2),
        "filters": make_table(FILTERS, measured.filters),
    }


def list_facts(entry: Entry, origin: Origin, states: StateSet, measured: Measured) -> dict[str, str]:
    """List what was compared, and on how many states."""
    result = origin.result
    pairs = measured.cka_between_seeds(measured.layers[0])
    seeds = dict.fromkeys(name for row in pairs for name in (row.first, row.second))
    # Each probe with pixels and with untrained networks.
    comparisons = 2 * len(measured.explained_probes)
    facts = {
        "network": f"{measured.explained.name} ({entry.policy})",
        "trained on case": result.target if result else "",
        "source case": (result.source or "") if result else "",
        "copied layers": ", ".join(origin.copied),
        "frozen layers": ", ".join(origin.copied) if origin.is_frozen else "",
        "all networks": ", ".join(f"{one.name} ({one.role})" for one in measured.networks),
        "different seeds": ", ".join(seeds),
        "states": f"{len(states.states)} of {len(set(states.episode))} episodes",
        "held-out episodes": str(len(set(states.episode[states.held_out]))),
        "probe comparisons": str(comparisons),
        # One end of a 95 % interval.
        "expected ▲ by chance": f"{0.025 * comparisons:.1f}",
    }
    return {key: value or MISSING for key, value in facts.items()}


def render(
    measured: Measured, facts: dict[str, str], figures: dict[str, Path], case: str, command: str
) -> str:
    """Render the page; `figures` are PNG files by name."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("page.html").render(
        name=measured.explained.name,
        case=case,
        command=command,
        facts=facts,
        tables=make_tables(measured),
        figures={name: base64.b64encode(path.read_bytes()).decode() for name, path in figures.items()},
    )
