"""The page: one HTML file that needs nothing else, and the numbers behind its figures as CSV."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
from matplotlib.figure import Figure

from ship_trl.explain.rows import Measured, Role
from ship_trl.explain.words import Answer, layer_readings, number, pairs, percent, seeds
from ship_trl.files.disk import replacing


@dataclass(frozen=True)
class Drawn:
    """A figure: its title, how to read it, and its PNG."""

    title: str
    caption: str
    png: Path


def write_figure(path: Path, figure: Figure) -> Path:
    """Write a figure as PNG; the same figure gives the same bytes."""
    with replacing(path) as draft:
        figure.savefig(draft, format="png", metadata={"Software": None})
    return path


def readings(measured: Measured) -> list[list[str]]:
    """Every probe of the explained network, as words."""
    found = []
    for row in measured.probes:
        if row.network != measured.explained.name:
            continue
        assert row.over_pixels is not None and row.over_untrained is not None
        differences = [number(row.over_pixels), number(row.over_untrained)]
        found.append([row.quantity, row.layer, number(row.r2), *differences, f"{row.shuffled_r2:.2f}"])
    return found


def likeness(measured: Measured) -> list[list[str]]:
    """CKA by layer as words: before and after, source, other seeds, untrained."""

    def one(first: Role, second: Role, layer: str) -> str:
        rows = pairs(measured, first, second, layer)
        return number(rows[0].cka, 3) if rows else "-"

    found = []
    for layer in measured.layers:
        alike, _ = seeds(measured, layer)
        values = [row.cka.value for row in alike]
        blank = [row.cka.value for row in pairs(measured, Role.explained, Role.untrained, layer)]
        found.append(
            [
                layer,
                one(Role.source, Role.before, layer),
                one(Role.before, Role.explained, layer),
                one(Role.source, Role.explained, layer),
                f"{min(values):.3f} to {max(values):.3f}" if values else "-",
                f"{min(blank):.3f} to {max(blank):.3f}",
            ]
        )
    return found


def in_numbers(measured: Measured) -> list[list[str]]:
    """Layers of the explained network in numbers, as words."""
    return [
        [
            row.layer,
            str(row.filters),
            str(row.silent),
            f"{row.active:.0%}",
            "-" if row.changed is None else f"{row.changed:.1%}",
        ]
        for row in measured.by_layer
        if row.network == measured.explained.name
    ]


def moved(measured: Measured) -> list[list[str]]:
    """Things erased, of every network, as words."""
    return [
        [
            row.thing,
            row.network,
            str(row.states),
            percent(row.changed),
            f"{row.moved:.2f}",
            f"{row.gradient:.1f}",
        ]
        for row in measured.erased
    ]


def render(
    measured: Measured, answers: Sequence[Answer], figures: Sequence[Drawn], about: dict[str, Any]
) -> str:
    """Make the page.

    Args:
        measured: every number.
        answers: what follows from them.
        figures: what was drawn.
        about: case, command, counts of states, what was copied; see `page.html`.
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("page.html").render(
        name=measured.explained.name,
        networks=[(one.name, one.role.value) for one in measured.shown],
        answers=answers,
        figures=[
            {"title": f.title, "caption": f.caption, "data": base64.b64encode(f.png.read_bytes()).decode()}
            for f in figures
        ],
        sums=layer_readings(measured),
        readings=readings(measured),
        likeness=likeness(measured),
        in_numbers=in_numbers(measured),
        moved=moved(measured),
        **about,
    )
