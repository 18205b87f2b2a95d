"""The words on the page follow from the numbers, whichever way those fall."""

from typing import Any

import pytest

from ship_trl.explain.bootstrap import Estimate
from ship_trl.explain.rows import CKARow, ErasedRow, LayerRow, Measured, ProbeRow, Role, Shown
from ship_trl.explain.words import best_layers, on_actions, on_change, on_filters, on_probes, on_training
from tests.explain.worlds import a_network

NAMES = {Role.explained: "mine", Role.before: "first", Role.source: "old", Role.untrained: "drawn"}


def near(value: float, by: float = 0.01) -> Estimate:
    return Estimate(value, value - by, value + by)


def a_probe(
    role: Role, layer: str, r2: float, pixels: float = 0.5, blank: float = 0.5, **more: Any
) -> ProbeRow:
    values: dict[str, Any] = {
        "quantity": "bearing of the goal",
        "checked_r2": r2,
        "shuffled_r2": 0.0,
        "penalty": 1.0,
        "over_pixels": near(r2 - pixels),
        "over_untrained": near(r2 - blank),
    }
    return ProbeRow(NAMES[role], role, layer, r2=near(r2), **values | more)


def likeness(first: str, second: str, value: float, alike: bool = False) -> CKARow:
    of = {name: role for role, name in NAMES.items()}
    one, other = (of.get(name, Role.beside) for name in (first, second))
    return CKARow(first, one, second, other, "conv1", alike, near(value))


def measured(**changes: Any) -> Measured:
    network = a_network()
    kin = ("low", "FT3", "4")
    shown = [Shown(name, role, network) for role, name in NAMES.items() if role is not Role.explained]
    values: dict[str, Any] = {
        "shown": (
            Shown("mine", Role.explained, network, kin),
            *shown,
            *(Shown(name, Role.beside, network, ("low", "scratch", "4")) for name in ("one", "two")),
        ),
        "layers": ("conv1",),
        "probes": [],
        "alike": [],
        "by_layer": [],
        "erased": [],
    }
    return Measured(**values | changes)


@pytest.mark.parametrize(
    ("r2", "pixels", "blank", "said", "told"),
    [
        (0.9, 0.5, 0.5, "1 of 1", "better than from raw pixels and untrained networks"),
        (0.9, 0.5, 0.9, "0 of 1", "better than from raw pixels, no better than from untrained networks"),
        (0.9, 0.95, 0.5, "0 of 1", "better than from untrained networks, no better than from raw pixels"),
        (0.9, 0.9, 0.9, "0 of 1", "no better than from either control"),
    ],
)
def test_a_probe_must_beat_both_controls(
    r2: float, pixels: float, blank: float, said: str, told: str
) -> None:
    answer = on_probes(measured(probes=[a_probe(Role.explained, "conv1", r2, pixels, blank)]))
    assert answer.short.startswith(said) and told in answer.long[0]


def test_the_layer_is_not_chosen_on_held_out_episodes() -> None:
    rows = [
        a_probe(Role.explained, "conv1", 0.6, checked_r2=0.7),
        a_probe(Role.explained, "conv2", 0.9, checked_r2=0.5),
    ]
    assert [row.layer for row in best_layers(measured(probes=rows))] == ["conv1"]


@pytest.mark.parametrize(("mine", "said"), [(0.9, "Most in conv1: 1 of 1"), (0.5, "In none")])
def test_training_makes_a_difference_or_none(mine: float, said: str) -> None:
    rows = [
        a_probe(Role.explained, "conv1", mine),
        a_probe(Role.untrained, "conv1", 0.5, over_untrained=None),
        ProbeRow("pixels", "pixels", "pixels", "bearing of the goal", near(0.5), 0.5, 0.0, 1.0, None, None),
    ]
    assert on_training(measured(probes=rows)).short.startswith(said)


@pytest.mark.parametrize(
    ("kept", "said"),
    [
        (0.95, "training changed less than two seeds differ in conv1"),
        (0.5, "training changed more than two seeds differ in conv1"),
        (0.81, "training changed about as much as two seeds differ in conv1"),
        (1.0, "None: the least alike is conv1, with a CKA of 1.00"),
        (1.0, "conv1 stayed as it was"),
    ],
)
def test_change_is_judged_beside_seeds(kept: float, said: str) -> None:
    rows = [likeness("mine", "first", kept), likeness("one", "two", 0.8, alike=True)]
    assert said in on_change(measured(alike=rows)).short


def test_without_other_seeds_nothing_is_said_of_them() -> None:
    assert "nothing says how much" in on_change(measured(alike=[likeness("mine", "first", 0.9)])).short


def test_seeds_of_its_own_arm_come_first() -> None:
    network = a_network()
    kin = ("low", "FT3", "4")
    shown = (*measured().shown, Shown("twin", Role.beside, network, kin))
    rows = [
        likeness("mine", "first", 0.9),
        likeness("one", "two", 0.5, alike=True),
        likeness("mine", "twin", 0.99, alike=True),
    ]
    short = on_change(measured(shown=shown, alike=rows)).short
    assert "two networks of the arm FT3" in short and "changed more than" in short


def test_of_a_file_alone_the_change_is_not_known() -> None:
    shown = (Shown("mine", Role.explained, a_network()),)
    assert on_change(measured(shown=shown)).short.startswith("Not known")


def test_the_thing_that_matters_most_is_named() -> None:
    rows = [
        ErasedRow("mine", Role.explained, "the ship", 100, near(0.7), near(0.6), 1.0, 3.0),
        ErasedRow("mine", Role.explained, "the line to the goal", 100, near(0.2), near(0.0), 0.1, 0.9),
        *(
            ErasedRow("drawn", Role.untrained, thing, 100, near(0.1), None, 0.5, 1.0)
            for thing in ("the ship", "the line to the goal")
        ),
    ]
    answer = on_actions(measured(erased=rows))
    assert answer.short.startswith("The ship, most of all") and "70% (69% to 71%)" in answer.short
    assert "more often than in untrained networks (10%)" in answer.long[0]
    assert "as often as in untrained networks" in answer.long[1]


@pytest.mark.parametrize(("mine", "said"), [(0.4, "Yes"), (0.0, "Not by this measure")])
def test_filters_are_judged_beside_drawn_ones(mine: float, said: str) -> None:
    rows = [
        LayerRow("mine", Role.explained, "conv1", 32, 3, 0.25, 0.1, near(mine)),
        LayerRow("drawn", Role.untrained, "conv1", 32, 0, 0.5, None, near(0.0)),
    ]
    answer = on_filters(measured(by_layer=rows))
    assert answer.short.startswith(said) and "3 of 32" in answer.long[0]
