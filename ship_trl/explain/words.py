"""What follows from the numbers, in words: each sentence is made of what was measured in this run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ship_trl.explain.bootstrap import Estimate
from ship_trl.explain.rows import CKARow, ErasedRow, Measured, ProbeRow, Role

# What is alike to this is not told apart from 1.
SAME = 0.9995


@dataclass(frozen=True)
class Answer:
    """A question, the answer in a few words, and the numbers that it stands on."""

    question: str
    short: str
    long: list[str]


def number(found: Estimate, digits: int = 2) -> str:
    """Write an estimate with its interval."""
    value, low, high = (f"{one:z.{digits}f}" for one in found)
    return f"{value} ({low} to {high})"


def percent(found: Estimate) -> str:
    """Write a share with its interval."""
    return f"{found.value:.0%} ({found.low:.0%} to {found.high:.0%})"


def listed(names: list[str]) -> str:
    """Write names as people do: a, b and c."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def of_explained(measured: Measured) -> list[ProbeRow]:
    """Take the readings of the explained network."""
    return [row for row in measured.probes if row.network == measured.explained.name]


def above(found: Estimate | None) -> bool:
    """Whether a difference is surely above zero."""
    return found is not None and found.low > 0


def below(found: Estimate | None) -> bool:
    """Whether a difference is surely below zero."""
    return found is not None and found.high < 0


def best_layers(measured: Measured) -> list[ProbeRow]:
    """Of each quantity the layer that reads it best on the episodes that chose the penalty.

    Not on the held-out ones, on which the best of several would look better than it is.
    """
    rows = of_explained(measured)
    quantities = list(dict.fromkeys(row.quantity for row in rows))
    return [max((r for r in rows if r.quantity == q), key=lambda r: r.checked_r2) for q in quantities]


def on_probes(measured: Measured) -> Answer:
    """Answer whether bearings and distances are read better than from the controls."""
    best = best_layers(measured)
    question = "Can bearings and distances be read from the layers, and did training put them there?"
    both = [row for row in best if above(row.over_pixels) and above(row.over_untrained)]
    short = (
        f"{len(both)} of {len(best)} quantities are read from their best layer better than from raw pixels "
        "and better than from the same layer of untrained networks"
    )
    short += f": the {listed([f'{row.quantity} ({row.layer})' for row in both])}." if both else "."
    long = []
    for row in best:
        better = [
            name
            for name, over in (("raw pixels", row.over_pixels), ("untrained networks", row.over_untrained))
            if above(over)
        ]
        words = f"better than from {listed(better)}" if better else "no better than from either control"
        if len(better) == 1:
            words += (
                f", no better than from {'untrained networks' if better[0] == 'raw pixels' else 'raw pixels'}"
            )
        assert row.over_pixels is not None and row.over_untrained is not None
        long.append(
            f"The {row.quantity}: R² {number(row.r2)} from {row.layer}, {words} (difference to pixels "
            f"{number(row.over_pixels)}, to untrained {number(row.over_untrained)})."
        )
    return Answer(question, short, long)


@dataclass(frozen=True)
class LayerReading:
    """A layer over all quantities: mean R² of the network and its controls, how many surely differ."""

    layer: str
    explained: float
    untrained: float
    pixels: float
    above_untrained: int
    below_untrained: int
    above_pixels: int
    below_pixels: int
    of: int


def layer_readings(measured: Measured) -> list[LayerReading]:
    """Sum the probes up by layer."""

    def mean(rows: list[ProbeRow]) -> float:
        return float(np.mean([row.r2.value for row in rows]))

    pixels = mean([row for row in measured.probes if row.role == "pixels"])
    found = []
    for layer in measured.layers:
        mine = [row for row in of_explained(measured) if row.layer == layer]
        blank = [row for row in measured.probes if row.layer == layer and row.role == Role.untrained]
        found.append(
            LayerReading(
                layer,
                mean(mine),
                mean(blank),
                pixels,
                sum(above(row.over_untrained) for row in mine),
                sum(below(row.over_untrained) for row in mine),
                sum(above(row.over_pixels) for row in mine),
                sum(below(row.over_pixels) for row in mine),
                len(mine),
            )
        )
    return found


def on_training(measured: Measured) -> Answer:
    """Answer in which layer training makes a difference to what can be read."""
    question = "In which layers does training make a difference to what can be read?"
    rows = layer_readings(measured)
    most = max(rows, key=lambda row: row.above_untrained + (row.explained - row.untrained))
    if most.above_untrained == 0:
        short = "In none: no layer reads any quantity surely better than that of untrained networks."
    else:
        short = (
            f"Most in {most.layer}: {most.above_untrained} of {most.of} quantities are read better than from "
            f"untrained networks there, mean R² {most.explained:.2f} against {most.untrained:.2f}."
        )
    long = [
        f"{row.layer}: mean R² {row.explained:.2f}, untrained {row.untrained:.2f}, pixels {row.pixels:.2f}. "
        f"Of {row.of} quantities, {row.above_untrained} are read better and {row.below_untrained} worse than "
        f"from untrained networks, {row.above_pixels} better and {row.below_pixels} worse than from pixels."
        for row in rows
    ]
    return Answer(question, short, long)


def pairs(measured: Measured, first: Role, second: Role, layer: str) -> list[CKARow]:
    """CKA of networks of two roles in a layer."""
    wanted = {first.value, second.value}
    return [
        row for row in measured.alike if row.layer == layer and {row.first_role, row.second_role} == wanted
    ]


def seeds(measured: Measured, layer: str) -> tuple[list[CKARow], str]:
    """Find CKA of networks trained alike but for the seed, of the explained one's arm if there are."""
    alike = [row for row in measured.alike if row.layer == layer and row.alike]
    kin = measured.explained.kin
    own = {one.name for one in measured.shown if one.kin is not None and one.kin == kin}
    mine = [row for row in alike if {row.first, row.second} <= own]
    chosen = mine or alike
    arms = {one.kin[1] for one in measured.shown if one.kin and one.name in {r.first for r in chosen}}
    return chosen, listed(sorted(arms)) if arms else ""


def on_change(measured: Measured) -> Answer:
    """Answer which layers training changed, and whether by more than two seeds differ."""
    question = "Which layers did training change, and is that more or less than two seeds differ?"
    if not measured.role(Role.before):
        return Answer(
            question, "Not known: the first network is a file, or its start could not be drawn again.", []
        )
    verdicts: dict[str, list[str]] = {"less": [], "more": [], "about as much": []}
    change: dict[str, Estimate] = {}
    long, arms, count = [], "", 0
    for layer in measured.layers:
        (kept,) = pairs(measured, Role.explained, Role.before, layer)
        change[layer] = kept.cka
        others, arms = seeds(measured, layer)
        words = f"{layer}: CKA of before and after {number(kept.cka)}"
        if others:
            values = [row.cka.value for row in others]
            count = len(values)
            less = kept.cka.low > max(row.cka.high for row in others)
            more = kept.cka.high < min(row.cka.low for row in others)
            verdict = "less" if less else "more" if more else "about as much"
            verdicts[verdict].append(layer)
            spread = f"{min(values):.2f}" if len(values) == 1 else f"{min(values):.2f} to {max(values):.2f}"
            words += f"; of two seeds {spread} ({len(values)} {'pair' if len(values) == 1 else 'pairs'})"
        long.append(words + ".")
    least = min(change, key=lambda layer: change[layer].value)
    same = [layer for layer in measured.layers if change[layer].value >= SAME]
    if len(same) == len(measured.layers):
        short = f"None: the least alike is {least}, with a CKA of {number(change[least])} with itself before."
    else:
        short = f"Most of all {least}, to a CKA of {number(change[least])} with itself before training."
    if same:
        short += f" {listed(same)} stayed as {'it was' if len(same) == 1 else 'they were'}."
    if arms:
        told = [
            f"{verdict} than two seeds differ in {listed(names)}"
            if verdict != "about as much"
            else f"about as much as two seeds differ in {listed(names)}"
            for verdict, names in verdicts.items()
            if names
        ]
        beside = "two networks" if count == 1 else f"{count} pairs of networks"
        short += f" Beside {beside} of the arm {arms} and other seeds, training changed {'; '.join(told)}."
    else:
        short += " No two networks of one arm and other seeds were given, so nothing says how much that is."
    return Answer(question, short, long)


def sizes(row: ErasedRow) -> tuple[float, float, float]:
    """Take what a row of a thing erased measures."""
    return row.changed.value, row.moved, row.gradient


def on_actions(measured: Measured) -> Answer:
    """Answer what in the picture moves the chosen action."""
    question = "What in the picture moves the chosen action?"
    rows = [row for row in measured.erased if row.network == measured.explained.name]
    most = max(rows, key=lambda row: row.changed.value)
    control = [row for row in measured.erased if row.thing == most.thing and row.role == Role.untrained]
    often, still = np.mean([row.changed.value for row in control]), [row.moved for row in control]
    further = "further than" if most.moved > max(still) else "as far as"
    further = "less far than" if most.moved < min(still) else further
    short = (
        f"{most.thing.capitalize()}, most of all: erased, it changes the action in {percent(most.changed)} "
        f"of the states in which it is seen, in untrained networks in {often:.0%}. Measured by how they vary "
        f"between states, advantages move {further} in untrained networks."
    )
    long = []
    for row in rows:
        control = [r for r in measured.erased if r.thing == row.thing and r.role == Role.untrained]
        apart = "more" if above(row.over_untrained) else "less" if below(row.over_untrained) else None
        verdict = f"{apart} often than" if apart else "as often as"
        blank = [float(np.mean(each)) for each in zip(*map(sizes, control), strict=True)]
        long.append(
            f"{row.thing.capitalize()} erased: another action in {percent(row.changed)} of {row.states} "
            f"states, {verdict} in untrained networks ({blank[0]:.0%}). The advantages move by "
            f"{row.moved:.2f} of how they vary from state to state (untrained {blank[1]:.2f}), and its "
            f"pixels have {row.gradient:.1f} times the gradient of a mean pixel (untrained {blank[2]:.1f})."
        )
    return Answer(question, short, long)


def on_filters(measured: Measured) -> Answer:
    """Answer whether the filters of the first layer look learned, and how many are silent."""
    question = "Do the filters of the first layer differ from drawn weights?"
    rows = [row for row in measured.by_layer if row.network == measured.explained.name]
    first = next(row.neighbours for row in rows if row.neighbours is not None)
    drawn = [row.neighbours for row in measured.by_layer if row.role == Role.untrained and row.neighbours]
    blank = [one.value for one in drawn]
    # Both have an interval: of three untrained networks one may lie far out by chance.
    outside = first.low > max(one.high for one in drawn) or first.high < min(one.low for one in drawn)
    short = (
        f"{'Yes' if outside else 'Not by this measure'}: neighbouring weights of conv1 correlate by "
        f"{number(first)}, those of untrained networks by {min(blank):z.2f} to {max(blank):z.2f}."
    )
    long = []
    for row in rows:
        words = (
            f"{row.layer}: {row.silent} of {row.filters} filters or units fire on no state, and the mean one "
        )
        words += f"fires in {row.active:.0%} of places and states"
        if row.changed is not None:
            words += f"; training moved its weights by {row.changed:.0%} of their norm"
        long.append(words + ".")
    return Answer(question, short, long)


def answers(measured: Measured) -> list[Answer]:
    """All answers, in the order of the page."""
    makers = (on_probes, on_training, on_change, on_actions, on_filters)
    return [make(measured) for make in makers]
