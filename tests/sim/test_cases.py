"""Case files: the bundled ones, a user's own, and invalid ones."""

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import conf_dir, conf_files
from ship_trl.config.types import World
from ship_trl.sim.cases import (
    GIVES_WAY,
    HOLDS_COURSE,
    MAX_TARGET_SHIPS,
    Case,
    load_case,
    readable_cases,
    shadowing_file,
    to_course,
    to_heading,
)
from ship_trl.sim.state import OWN_SIZE, SHIP_BEHAVIOUR, initial_state

PAPER = ["1", "2", "3", "4", "5", "6", "new"]
BUNDLED = [*PAPER, "ship"]
SHIP = "  - {x: 100.0, y: 300.0, heading: 180.0, speed: 15.0}\n"
GOOD = f"""\
start: [0.0, 0.0]
heading: 90.0
goal: [0.0, 600.0]
ideal_path: straight
target_ships:
{SHIP}"""
COURSE = GOOD.replace("heading: 90.0", "course: 045")


def load_text(text: str | bytes, folder: Path, world: World) -> Case:
    """Load a case from a file `mine.yaml` with this content."""
    path = folder / "mine.yaml"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return load_case(str(path), world)


def with_value(key: str, value: str) -> str:
    """Return the good file with another value of a key at its top level."""
    return re.sub(rf"^{key}: .*$", f"{key}: {value}", GOOD, flags=re.MULTILINE)


def without(field: str) -> str:
    return "".join(line for line in GOOD.splitlines(keepends=True) if not line.startswith(field))


def with_ship(**changes: str) -> str:
    ship = {"x": "100.0", "y": "300.0", "heading": "180.0", "speed": "15.0"} | changes
    return GOOD.replace(SHIP, "  - {" + ", ".join(f"{k}: {v}" for k, v in ship.items() if v) + "}\n")


def test_the_bundled_cases_are_those_of_the_paper(world: World) -> None:
    ships = {name: load_case(name, world).target_ships for name in PAPER}
    assert [len(ships[name]) for name in PAPER] == [0, 1, 1, 2, 1, 2, 2]
    # The target of each pair is its source with one more target ship.
    for fewer, more in (("1", "2"), ("3", "4"), ("5", "6"), ("2", "new")):
        assert ships[more][:-1] == ships[fewer]
    # Our own case: the ships of cases 2 and 3.
    assert load_case("ship", world).target_ships == [*ships["2"], *ships["3"]]


def test_the_fingerprint_depends_on_the_values_not_the_name(tmp_path: Path, world: World) -> None:
    case = load_case("2", world)
    copy = tmp_path / "mine.yaml"
    copy.write_text((conf_dir() / "case" / "2.yaml").read_text())
    assert load_case(str(copy), world).fingerprint == case.fingerprint
    assert len({load_case(name, world).fingerprint for name in BUNDLED}) == len(BUNDLED)


@pytest.mark.parametrize(
    ("text", "field"),
    [
        (without("start"), "start"),
        (without("heading"), "course: missing"),
        (GOOD + "course: 000\n", "course and heading: must be one of them: course (degrees clockwise"),
        (with_ship(heading=""), "target_ships[0].course: missing"),
        (COURSE.replace("045", "361"), "course: must be less than or equal to 360, got 361"),
        (GOOD + "depth: 20.0\n", "depth"),
        (with_ship(colour="3.0"), "target_ships[0].colour"),
        (with_value("heading", ".nan"), "heading"),
        (with_value("goal", "[0.0, 1.0e+300]"), "goal[1]"),
        (with_value("goal", "[0.0, 600.0, 5.0]"), "goal"),
        (with_ship(speed="-1.0"), "target_ships[0].speed"),
        (with_ship(behaviour="rams"), "target_ships[0].behaviour: must be 'holds'"),
        (with_ship(x="10.0", y="43.0", heading="0.0"), "target_ships[0]"),
        (with_value("goal", "[0.0, 60.0]"), "goal"),
        (with_value("goal", "[0.0, 2000.0]"), "goal: cannot be reached: 1940 m"),
        (GOOD + SHIP * MAX_TARGET_SHIPS, "target_ships"),
        (GOOD + "unit: 1.0e+3\n", "unit: must keep all coordinates within 100000 m"),
        (GOOD.replace(SHIP, "  - ???\n"), "target_ships[0]"),
        (GOOD + '"\\e[31mred": 1\n', "\\x1b[31mred: unknown key;"),
    ],
)
def test_a_bad_value_is_refused_with_file_and_field(
    text: str, field: str, tmp_path: Path, world: World
) -> None:
    assert text != GOOD
    with pytest.raises(ConfigError) as error:
        load_text(text, tmp_path, world)
    message = str(error.value)
    assert message.startswith(f"{tmp_path / 'mine.yaml'}: {field}") and "\n" not in message


@pytest.mark.parametrize("content", [b"start: [0.0, 0.0\n", b"- 1\n- 2\n", b"", b"\xff\xfe\x00"])
def test_a_file_that_is_no_case_is_refused(content: bytes, tmp_path: Path, world: World) -> None:
    with pytest.raises(ConfigError) as error:
        load_text(content, tmp_path, world)
    message = str(error.value)
    assert message.startswith(f"{tmp_path / 'mine.yaml'}: ") and "\n" not in message


@pytest.mark.parametrize("name", ["9", "a" * 300, "mine.yaml", ""])
def test_a_case_that_is_not_there(name: str, world: World) -> None:
    with pytest.raises(
        ConfigError, match=r"^target: no case .*; allowed: .*1, 2, .*new, .*ship, .*or a path"
    ) as error:
        load_case(name, world, key="target")
    assert "\n" not in str(error.value)


def test_a_users_case_by_name(tmp_path: Path, world: World) -> None:
    folder = tmp_path / "conf" / "case"
    folder.mkdir(parents=True)
    (folder / "mine.yaml").write_text(GOOD)
    # The working directory's cases come before the bundled ones.
    (folder / "1.yaml").write_text(GOOD)
    (folder / "2.yaml").write_text((conf_dir() / "case" / "2.yaml").read_text())
    bundled = {path.stem for path in (conf_dir() / "case").glob("*.yaml")}
    assert set(conf_files("case")) == bundled | {"mine"} and bundled > set(BUNDLED)
    assert load_case("mine", world).target_ships and load_case("1", world).target_ships
    assert not load_case("3", world).target_ships[1:]
    # A case that differs from the bundled one of its name is reported.
    shadowed = {name for name in conf_files("case") if shadowing_file("case", name)}
    assert shadowed == {"1"} and shadowing_file("case", "1") == Path("conf/case/1.yaml")


def test_a_unit_scales_coordinates_and_nothing_else(tmp_path: Path, world: World) -> None:
    in_units = GOOD.replace("600.0", "2.0").replace("x: 100.0, y: 300.0", "x: 0.5, y: -1.5")
    case = load_text(in_units + "unit: 300.0\n", tmp_path, world)
    plain = load_text(with_ship(x="150.0", y="-450.0"), tmp_path, world)
    assert case == plain and case.fingerprint == plain.fingerprint
    assert (case.heading, case.target_ships[0].heading, case.target_ships[0].speed) == (90.0, 180.0, 15.0)
    assert load_case(str(tmp_path / "mine.yaml"), world, unit=0.5).target_ships[0].x == 75.0


def test_a_case_file_may_name_the_behaviour(tmp_path: Path, world: World) -> None:
    texts = (with_ship(behaviour=one) for one in ("", "holds", "gives_way"))
    plain, holds, gives_way = (load_text(text, tmp_path, world) for text in texts)
    assert plain.fingerprint == holds.fingerprint != gives_way.fingerprint
    assert [float(initial_state(one, world)[OWN_SIZE + SHIP_BEHAVIOUR]) for one in (plain, gives_way)] == [
        HOLDS_COURSE,
        GIVES_WAY,
    ]


def test_a_goal_at_the_end_of_the_last_step_is_reached(tmp_path: Path, world: World) -> None:
    # 60 steps of a second at 15 m/s, and 60 m from the goal is near enough.
    assert load_text(with_value("goal", "[0.0, 960.0]"), tmp_path, world).goal == [0.0, 960.0]
    with pytest.raises(ConfigError, match=r"901 m .* 60 steps \(world.max_steps\) of 1 s at up to 15 m/s"):
        load_text(with_value("goal", "[0.0, 961.0]"), tmp_path, world)


@pytest.mark.parametrize(("course", "heading"), [("000", 90), ("135", -45), ("225", 225), ("360", 90)])
def test_a_course_is_clockwise_from_north(course: str, heading: float, tmp_path: Path, world: World) -> None:
    text = COURSE.replace("045", course).replace("heading: 180.0", f"course: {course}")
    case = load_text(text, tmp_path, world)
    assert (case.heading, case.target_ships[0].heading) == (heading, heading)
    # To the bit as with `heading:`, which files may still have.
    old = GOOD.replace("heading: 90.0", f"heading: {heading}").replace("180.0", str(heading))
    assert load_text(old, tmp_path, world).fingerprint == case.fingerprint


@given(st.floats(0, 360, exclude_max=True))
def test_a_heading_has_one_course_and_a_course_one_heading(course: float) -> None:
    heading = to_heading(course)
    assert -90 <= heading < 270
    # A course of 1e-300 degrees is lost beside 90.
    assert to_course(heading) == pytest.approx(course, abs=1e-12) or course < 1e-12


def test_a_broken_file_is_named_and_left_out(
    tmp_path: Path, world: World, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "conf/case"
    folder.mkdir(parents=True)
    (folder / "mine.yaml").write_text(GOOD)
    (folder / "broken.yaml").write_text("start: [0,\n")
    assert {case.name for case in readable_cases(world)} == set(conf_files("case")) - {"broken"}
    said = capsys.readouterr().err
    assert (
        said.startswith("ship_trl: left out: conf/case/broken.yaml: not readable as YAML")
        and said.count("\n") == 1
    )
