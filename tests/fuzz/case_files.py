"""Case files: right ones, damaged ones, and files that are none."""

from __future__ import annotations

import math
from typing import Any

import yaml
from hypothesis import strategies as st

from tests.fuzz.trees import damaged
from tests.fuzz.values import any_float, magnitude, mostly, texts

near = st.floats(-800, 800)
# Where a number is allowed to be, and beyond.
far = st.one_of(
    st.floats(-1e5, 1e5), magnitude(1e-40, 1e40), any_float, st.sampled_from([1e5, -1e5, 1.00001e5])
)
wide = mostly(st.floats(-1e4, 1e4), far, 30)


@st.composite
def cases(draw: st.DrawFn) -> dict[str, Any]:
    """A case whose ships lie anywhere, some upon the start or the goal, some very far or very fast."""
    start, heading = [draw(near), draw(near)], draw(wide)
    way, course = draw(mostly(st.floats(70, 950), st.floats(50, 1000))), draw(st.floats(-math.pi, math.pi))
    goal = [start[0] + way * math.cos(course), start[1] + way * math.sin(course)]
    ships = []
    for _ in range(draw(mostly(st.integers(0, 4), st.sampled_from([8, 9, 100])))):
        anywhere = st.tuples(near, near), st.tuples(wide, wide)
        place = draw(mostly(st.one_of(anywhere), st.sampled_from([start, goal]), 20))
        speed = draw(mostly(st.floats(0, 40), far, 20))
        ships.append({"x": place[0], "y": place[1], "heading": draw(wide), "speed": speed})
    return {
        "start": start,
        "heading": heading,
        "goal": goal,
        "ideal_path": draw(st.one_of(st.just("straight"), texts)),
        "target_ships": ships,
    }


@st.composite
def case_texts(draw: st.DrawFn) -> str:
    """A case as YAML, as it is or damaged."""
    values = draw(cases())
    values = draw(mostly(st.just(values), damaged(values, most=2), 3))
    flow = draw(st.sampled_from([None, True, False]))
    return yaml.safe_dump(values, default_flow_style=flow, allow_unicode=draw(st.booleans()), sort_keys=False)


GOOD = """\
start: [0.0, 0.0]
heading: 90.0
goal: [0.0, 600.0]
ideal_path: straight
target_ships:
  - {x: 100.0, y: 300.0, heading: 180.0, speed: 15.0}
"""


def laughs(levels: int, each: int, merge: bool = False) -> str:
    """Aliases of aliases: each doubles what is below it, or merges it."""
    lines = ["a0: &a0 {x: 1}" if merge else "a0: &a0 [x, x]"]
    for n in range(1, levels):
        below = ", ".join([f"*a{n - 1}"] * each)
        lines.append(f"a{n}: &a{n} {{<<: [{below}]}}" if merge else f"a{n}: &a{n} [{below}]")
    return "\n".join(lines) + "\n"


# Files that try what a reader of YAML may do wrong.
TRICKS = (
    "",
    "\n",
    "---\n---\n",
    "a\n...\nb\n",
    "[]",
    "null",
    "&a [*a]",
    "&a {a: *a}",
    "start: *nowhere",
    GOOD + "start: [1, 1]\n",
    GOOD.replace("{x: 100.0", "{x: 1, x: 100.0"),
    GOOD.replace("90.0", "!!python/object:os.system {}"),
    GOOD.replace("90.0", "!!python/object/apply:os.system ['true']"),
    GOOD.replace("90.0", "!!int ship"),
    GOOD.replace("90.0", "!!int ''"),
    GOOD.replace("90.0", "!!float ship"),
    GOOD.replace("90.0", "!!timestamp 2001-99-99"),
    GOOD.replace("90.0", "!!timestamp x"),
    GOOD.replace("90.0", "!!bool ship"),
    GOOD.replace("90.0", "!!binary '\u00fc'"),
    GOOD.replace("90.0", "!!binary aGk="),
    GOOD.replace("90.0", "!!set {a, b}"),
    GOOD.replace("90.0", "!!omap [a: 1]"),
    GOOD.replace("90.0", "!!null 90"),
    GOOD.replace("90.0", "!unknown 90"),
    GOOD.replace("90.0", "9" * 5000),
    GOOD.replace("90.0", "0x" + "f" * 5000),
    GOOD.replace("90.0", "0o" + "7" * 5000),
    GOOD.replace("90.0", "0b" + "1" * 20000),
    GOOD.replace("90.0", "1:" * 400 + "1"),
    GOOD.replace("90.0", "9" * 400),
    GOOD.replace("90.0", "1e999"),
    GOOD.replace("90.0", "2001-01-01"),
    GOOD.replace("90.0", "on"),
    GOOD.replace("90.0", "'90'"),
    GOOD.replace("90.0", "${oc.env:HOME}"),
    GOOD.replace("90.0", "${heading}"),
    GOOD.replace("90.0", "${oc.decode:'90'}"),
    GOOD.replace("90.0", "'${oc.create:{a: 1}}'"),
    GOOD.replace("90.0", "'${'"),
    GOOD.replace("[0.0, 600.0]", "${start}"),
    GOOD.replace("[0.0, 600.0]", "'[0, 600]'"),
    GOOD.replace("[0.0, 600.0]", "{0: 0.0, 1: 600.0}"),
    GOOD.replace("straight", '"a\\nb"'),
    GOOD.replace("straight", '"\\0"'),
    GOOD.replace("straight", '"\\ud800"'),
    GOOD.replace("straight", "[a]"),
    GOOD + '"a\\nb": 1\n',
    GOOD + '"\\e[31mred": 1\n',
    GOOD + "? [a]\n: 1\n",
    GOOD + "? {a: 1}\n: 1\n",
    GOOD + "1: 1\n",
    GOOD + "1.5: 1\n",
    GOOD + "null: 1\n",
    GOOD + "true: 1\n",
    GOOD + "!!binary aGk=: 1\n",
    GOOD + "<<: {heading: 3.0}\n",
    GOOD + "<<: 3\n",
    GOOD + "'a.b': 1\n",
    GOOD + "'': 1\n",
    GOOD.replace("    ", "\t"),
    GOOD.replace("\n", "\r\n"),
    GOOD.replace("\n", "\r"),
    "\ufeff" + GOOD,
    GOOD + "\x00",
    GOOD + "# \x07\n",
    "%YAML 9.9\n---\n" + GOOD,
    "%TAG ! tag:x,2000:\n---\n" + GOOD,
    "[" * 100,
    "[" * 3000 + "]" * 3000,
    "{a: " * 3000,
    "- " * 3000,
    "a" * 100_000,
    "'" + "a" * 1_000_000,
    GOOD + "#" + "a" * 1_000_000,
    GOOD + GOOD.splitlines()[-1].join(["", "\n"]) * 20_000,
    laughs(12, 12) + GOOD,
    laughs(40, 2) + GOOD,
    laughs(30, 2, merge=True) + GOOD,
    laughs(12, 12, merge=True) + GOOD,
    GOOD.replace("target_ships:", "a: &a {x: 1.0e5, y: 300.0, heading: 0.0, speed: 0.0}\ntarget_ships:"),
    GOOD.replace("  - {x", "  - &a {x") + "  - *a\n",
    GOOD + "  - 5\n",
    GOOD.replace("  - {", "  ship: {"),
)
EDGES = ("ff fe 00", "fe ff", "ef bb bf", "c3 28", "00", "ff", "80", "ed a0 80", "f8 88 80 80 80", "1f 8b 08")

bytes_of_files = st.one_of(
    st.binary(max_size=200),
    st.sampled_from([bytes.fromhex(edge) for edge in EDGES]),
    st.sampled_from(TRICKS).map(lambda text: text.encode("utf-8", "surrogatepass")),
    st.sampled_from(TRICKS).map(lambda text: text.encode("utf-16", "surrogatepass")),
    st.builds(
        lambda text, place, junk: text[: place % (len(text) + 1)] + junk + text[place % (len(text) + 1) :],
        st.just(GOOD.encode()),
        st.integers(0, 1000),
        st.one_of(
            st.binary(min_size=1, max_size=3),
            st.sampled_from([b"&a ", b"*a", b"!!", b"${", b"\t", b"\n", b"? ", b"- ", b"<<: "]),
        ),
    ),
)
