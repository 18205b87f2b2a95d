"""`python -m tests.tables`: write tables of the documents from the code, between their marks."""

from __future__ import annotations

import inspect
import re
from dataclasses import replace

import numpy as np

from ship_trl.config.network import load_network
from ship_trl.files.curve import COLUMNS
from ship_trl.gym import ShipCollisionVectorEnv
from ship_trl.sim import scene
from ship_trl.sim.cases import load_world
from ship_trl.sim.reward import TERMS
from ship_trl.sim.vector import VectorObservation
from tests.command import ROOT

PAGES = [ROOT / "docs/environment.md", ROOT / "docs/library.md"]
WORLD = load_world()
Rows = list[tuple[object, ...]]
# What the amount of a term is multiplied by; a new term needs a line.
FORMULAS = {
    "distance": "distance to the goal after the step, m",
    "deviation": "angle between bow and goal after the step, degrees",
    "goal": "1 if the goal is reached",
    "collision": "1 if a target ship comes inside the safe distance",
}


def actions() -> Rows:
    """Return the actions: index, name, turn and speed."""
    rows: Rows = [("action", "name", "turn, rad/s", "speed, m/s", "what it does")]
    for k, (speed, turn) in enumerate(WORLD.actions):
        side = "straight on" if turn == 0 else "to port" if turn > 0 else "to starboard"
        strength = {0.1: "hard ", 0.02: "", 0.01: "slightly "}.get(abs(turn), "")
        rows.append((k, f"a{k + 1}", f"{turn:+g}" if turn else "0", f"{speed:g}", strength + side))
    return rows


def pixels() -> Rows:
    """Return what the picture shows, with its grey (luminance), colour and size."""
    drawn = (
        ("outside of the disc", scene.OUTSIDE, ""),
        ("water", scene.DISC, f"disc, radius {scene.VIEW_RADIUS:g} m"),
        ("expected distance", scene.GOAL_CIRCLE, f"disc, radius {WORLD.goal_distance:g} m"),
        ("safe distance", scene.SAFE_CIRCLE, f"disc, radius {WORLD.safe_distance:g} m"),
        ("own ship", scene.OWN, f"hull, {scene.OWN_LENGTH:g} m"),
        ("line to the goal", scene.LINE, f"{scene.LINE_WIDTH:g} pixel wide, as long as the way"),
        ("target ships", scene.TARGET, f"hulls, {scene.TARGET_LENGTH:g} m"),
    )
    rows: Rows = [("what", "grey", "red, green, blue", "size")]
    for name, colour, size in drawn:
        grey = round(float(np.dot(scene.LUMINANCE, colour)))
        rows.append((name, grey, ", ".join(map(str, colour)), size))
    return rows


def vector() -> Rows:
    """Return the numbers of a vector observation, as its docstring explains them."""
    about = inspect.getdoc(VectorObservation) or ""
    own, ship, encounter = (
        [[cell.strip() for cell in line.split("|")] for line in group.splitlines()]
        for group in re.findall(r"(?:^ {4}.* \|.* \| .*\n)+", about, re.M)
    )
    rows: Rows = [("index", "number", "1 is", "range")]
    # The last number of a ship says whether there is one.
    ship[-1:-1] = encounter
    last = len(ship) * (load_network("vector").ships - 1)
    for k, meaning in enumerate([*own, *ship]):
        again = f", {k + len(ship)}, ... {k + last}" if k >= len(own) else ""
        rows.append((f"{k}{again}", *meaning))
    return rows


def reward() -> Rows:
    """Return the terms of the reward with their weights, each a product of keys of `world.reward`."""
    given = WORLD.reward
    rows: Rows = [("term", "weight", "of `world.reward`", "times")]
    for name, term in TERMS.items():
        changed = {key: replace(given, **{key: value + 1}) for key, value in vars(given).items()}
        keys = [f"`{key}`" for key, other in changed.items() if term.amount(other) != term.amount(given)]
        rows.append((name, f"{term.amount(given):+g}", " * ".join(keys), FORMULAS[name]))
    return rows


def ends() -> Rows:
    """Return what ends an episode."""
    steps, seconds = WORLD.max_steps, f"{WORLD.max_steps * WORLD.dt:g} s"
    return [
        ("what", "flag", "when"),
        ("goal", "`terminated`", f"own ship is at most {WORLD.goal_distance:g} m from its goal"),
        ("collision", "`terminated`", f"a target ship is less than {WORLD.safe_distance:g} m from own ship"),
        ("timeout", "`truncated`", f"{steps} steps, {seconds} (`max_episode_steps`)"),
    ]


def keys() -> Rows:
    """Return the arguments of the environment, as its docstring explains them."""
    about = inspect.getdoc(ShipCollisionVectorEnv) or ""
    listed = re.search(r"Args:\n(.*?)\n\n", about, re.S)
    told = dict(re.findall(r"^ {4}(\w+): (.*(?:\n {6,}.*)*)", listed[1] if listed else "", re.M))
    given = inspect.signature(ShipCollisionVectorEnv).parameters
    rows: Rows = [("key", "default", "what it is")]
    for name, one in given.items():
        if name not in ("num_envs", "autoreset_mode"):
            default = f'"{one.default}"' if isinstance(one.default, str) else one.default
            rows.append((f"`{name}`", f"`{default}`", " ".join(told[name].split())))
    return rows


def curve() -> Rows:
    """Return the columns of a learning curve."""
    return [("column", "what it is"), *((f"`{name}`", meaning) for name, meaning in COLUMNS.items())]


TABLES = {one.__name__: one for one in (actions, pixels, vector, reward, ends, keys, curve)}


def write_markdown(rows: Rows) -> str:
    """Write rows as a table of Markdown; the first one is the heading."""
    lines = ["| " + " | ".join(map(str, row)) + " |" for row in rows]
    return "\n".join([lines[0], "|" + " --- |" * len(rows[0]), *lines[1:]]).replace("|  |", "| |")


def fill(text: str) -> str:
    """Return a page with all its tables made again."""
    for name, table in TABLES.items():
        before, begin, rest = text.partition(f"<!-- begin: {name} -->\n")
        if not begin:
            continue
        _, end, after = rest.partition("<!-- end -->")
        assert end, name
        text = f"{before}{begin}{write_markdown(table())}\n{end}{after}"
    return text


if __name__ == "__main__":
    for page in PAGES:
        page.write_text(fill(page.read_text()))
