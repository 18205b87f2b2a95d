"""The tables of the documents say what the code does."""

import re

from ship_trl.config.network import load_network
from ship_trl.sim import scene
from ship_trl.sim.render import Rasteriser
from ship_trl.sim.vector import DCPA, LEFT, SINCE, TCPA, TURNED, VectorObservation
from tests.tables import PAGES, TABLES, WORLD, fill, pixels, vector


def test_the_tables_are_those_that_the_command_writes() -> None:
    texts = [page.read_text() for page in PAGES]
    assert [fill(text) for text in texts] == texts
    assert all(any(f"<!-- begin: {name} -->\n" in text for text in texts) for name in TABLES)


def test_each_number_of_a_vector_has_a_meaning_in_the_unit_of_the_code() -> None:
    rows = vector()[1:]
    network, first = load_network("vector"), network_indices(rows)
    own, size = network.own_numbers, network.ship_numbers
    assert [index for index, *_ in first] == list(range(own + size))
    last = size * (network.ships - 1)
    assert all(more == ([k + size, k + last] if k >= own else []) for k, *more in first)
    observation = VectorObservation(WORLD, 3)
    units: tuple[str, ...] = (
        f"{scene.VIEW_RADIUS:g} m",
        f"{observation.max_speed:g} m/s",
        f"{observation.max_turn:g} rad/s",
    )
    # 20 s is the unit of TCPA, and of the time since an onset.
    units += f"{TCPA:g} s", f"{LEFT:g} s", f"{DCPA:g} m", f"{TURNED:g} rad"
    assert {unit for _, _, unit, _ in rows} == {"", *units}
    assert TCPA == SINCE


def network_indices(rows: list[tuple[object, ...]]) -> list[list[int]]:
    """Return the numbers in the first cell of each row."""
    return [[int(index) for index in re.findall(r"[0-9]+", str(cell))] for cell, *_ in rows]


def test_the_greys_are_those_of_the_picture() -> None:
    greys = {name: grey for name, grey, *_ in pixels()[1:]}
    (picture,), middle = Rasteriser(WORLD).background.tolist(), scene.SIZE // 2
    assert picture[0][0] == greys["outside of the disc"] and picture[middle][5] == greys["water"]
    # Own ship's bow points up and is narrow.
    assert picture[middle][middle] == greys["own ship"]
    assert picture[middle - 2][middle + 1] == greys["safe distance"]
    # Edges are blurred.
    assert abs(picture[middle][middle + 3] - int(str(greys["expected distance"]))) < 10
