"""Case files: the shipped ones, a user's own, and every way to get one wrong."""

from pathlib import Path

import pytest

from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import conf_dir
from ship_trl.config.types import World
from ship_trl.sim.cases import MAX_TARGET_SHIPS, case_names, load_case, shadowing_case

PAPER = ["1", "2", "3", "4", "5", "6", "new"]
SHIPPED = [*PAPER, "ship"]
SHIP = "  - {x: 100.0, y: 300.0, heading: 180.0, speed: 15.0}\n"
GOOD = f"""\
start: [0.0, 0.0]
heading: 90.0
goal: [0.0, 600.0]
ideal_path: straight
target_ships:
{SHIP}"""


def without(field: str) -> str:
    return "".join(line for line in GOOD.splitlines(keepends=True) if not line.startswith(field))


def with_ship(**changes: str) -> str:
    ship = {"x": "100.0", "y": "300.0", "heading": "180.0", "speed": "15.0"} | changes
    return GOOD.replace(SHIP, "  - {" + ", ".join(f"{k}: {v}" for k, v in ship.items() if v) + "}\n")


@pytest.mark.parametrize("name", SHIPPED)
def test_every_shipped_case_loads(name: str, world: World) -> None:
    case = load_case(name, world)
    assert case.name == name and case.ideal_path
    assert (case.start, case.heading, case.goal) == ([0.0, 0.0], 90.0, [0.0, 600.0])
    assert all(ship.speed == 15.0 for ship in case.target_ships)


def test_the_shipped_cases_are_those_of_the_paper(world: World) -> None:
    ships = {name: load_case(name, world).target_ships for name in PAPER}
    assert [len(ships[name]) for name in PAPER] == [0, 1, 1, 2, 1, 2, 2]
    # The second of each pair is the first and one target ship more.
    for fewer, more in (("1", "2"), ("3", "4"), ("5", "6"), ("2", "new")):
        assert ships[more][:-1] == ships[fewer]
    # Ours: the ship of case 2 on the way of case 3.
    assert load_case("ship", world).target_ships == [*ships["2"], *ships["3"]]
    assert {path.stem for path in (conf_dir() / "case").glob("*.yaml")} == set(SHIPPED)


def test_the_fingerprint_is_of_the_values_not_the_name(tmp_path: Path, world: World) -> None:
    case = load_case("2", world)
    copy = tmp_path / "mine.yaml"
    copy.write_text((conf_dir() / "case" / "2.yaml").read_text())
    assert load_case(str(copy), world).fingerprint == case.fingerprint
    assert len({load_case(name, world).fingerprint for name in SHIPPED}) == len(SHIPPED)


@pytest.mark.parametrize(
    ("text", "field"),
    [
        (without("start"), "start"),
        (without("heading"), "heading"),
        (without("goal"), "goal"),
        (without("ideal_path"), "ideal_path"),
        (without("target_ships").replace(SHIP, ""), "target_ships"),
        (with_ship(speed=""), "target_ships[0].speed"),
        (GOOD + "depth: 20.0\n", "depth"),
        (with_ship(colour="3.0"), "target_ships[0].colour"),
        (GOOD.replace("heading: 90.0", "heading: .nan", 1), "heading"),
        (GOOD.replace("start: [0.0, 0.0]", "start: [.nan, 0.0]"), "start[0]"),
        (GOOD.replace("goal: [0.0, 600.0]", "goal: [0.0, .inf]"), "goal[1]"),
        (GOOD.replace("goal: [0.0, 600.0]", "goal: [0.0, 1.0e+300]"), "goal[1]"),
        (GOOD.replace("goal: [0.0, 600.0]", "goal: [0.0, [600.0]]"), "goal[1]"),
        (GOOD.replace("heading: 90.0", "heading: 1" + "0" * 400, 1), "heading: must be at most"),
        (with_ship(x="-.inf"), "target_ships[0].x"),
        (with_ship(heading=".nan"), "target_ships[0].heading"),
        (with_ship(speed=".inf"), "target_ships[0].speed"),
        (GOOD.replace("heading: 90.0", "heading: north", 1), "heading"),
        (GOOD.replace("start: [0.0, 0.0]", "start: [0.0, left]"), "start[1]"),
        (GOOD.replace("start: [0.0, 0.0]", "start: 0.0"), "start"),
        (GOOD.replace("start: [0.0, 0.0]", "start: [0.0]"), "start"),
        (GOOD.replace("goal: [0.0, 600.0]", "goal: [0.0, 600.0, 5.0]"), "goal"),
        (with_ship(y="ahead"), "target_ships[0].y"),
        (GOOD.replace(SHIP, "  - 5\n"), "target_ships[0]"),
        (GOOD.replace("target_ships:\n" + SHIP, "target_ships: none\n"), "target_ships"),
        (with_ship(speed="-1.0"), "target_ships[0].speed"),
        (with_ship(x="10.0", y="43.0", heading="0.0"), "target_ships[0]"),
        (GOOD.replace("goal: [0.0, 600.0]", "goal: [0.0, 0.0]"), "goal"),
        (GOOD.replace("goal: [0.0, 600.0]", "goal: [0.0, 60.0]"), "goal"),
        (GOOD.replace("goal: [0.0, 600.0]", "goal: [0.0, 2000.0]"), "goal: cannot be reached: 1940 m"),
        (GOOD + SHIP * MAX_TARGET_SHIPS, "target_ships"),
        (GOOD + "name: other\n", "name"),
        (GOOD.replace("heading: 90.0", "heading: ???", 1), "heading"),
        (GOOD.replace("heading: 90.0", "heading: null", 1), "heading: must be a finite number, got null"),
        (
            GOOD.replace("target_ships:\n" + SHIP, "target_ships:\n"),
            "target_ships: must be a list, as [A,B] or [], got null",
        ),
        (GOOD.replace("heading: 90.0", "heading: true", 1), "heading"),
        (GOOD.replace(SHIP, SHIP + "  - {x: 1.0}\n"), "target_ships[1].y"),
        (GOOD.replace(SHIP, "  - ???\n"), "target_ships[0]"),
        (GOOD.replace("start: [0.0, 0.0]", "start: [{}, 0.0]"), "start[0]: must be a finite number, got {}"),
        (
            GOOD.replace("goal: [0.0, 600.0]", "goal: {0: 0.0, 1: 600.0}"),
            "goal: must be a list, as [A,B] or [], got {0: 0.0",
        ),
        (with_ship(x="9" * 400), "target_ships[0].x: must be at most 9223372036854775807 in size, got 9999"),
        (GOOD + '"a\\nb": 1\n', "a\\nb: unknown key; allowed here: start,"),
        (GOOD + '"\\e[31mred": 1\n', "\\x1b[31mred: unknown key;"),
    ],
)
def test_a_bad_value_is_refused_by_file_and_field(
    text: str, field: str, tmp_path: Path, world: World
) -> None:
    assert text != GOOD
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError) as error:
        load_case(str(path), world)
    message = str(error.value)
    assert message.startswith(f"{path}: {field}") and "\n" not in message


@pytest.mark.parametrize(
    "content",
    [
        b"start: [0.0, 0.0\n",
        b"start: [0, 0]\n\tgoal: 3\n",
        b"- 1\n- 2\n",
        b"start\n",
        b"7\n",
        b'"1e400"\n',
        b"",
        b"# nothing\n",
        b"\xff\xfe\x00",
    ],
    ids=["unclosed", "tab", "list", "word", "number", "quoted", "empty", "comment", "binary"],
)
def test_a_file_that_is_no_case_is_refused(content: bytes, tmp_path: Path, world: World) -> None:
    path = tmp_path / "mine.yaml"
    path.write_bytes(content)
    with pytest.raises(ConfigError) as error:
        load_case(str(path), world)
    assert str(error.value).startswith(f"{path}: ") and "\n" not in str(error.value)


@pytest.mark.parametrize("name", ["9", "a" * 300, "mine.yaml", "no/such/folder/mine.yaml", "", "."])
def test_a_case_that_is_not_there(name: str, world: World) -> None:
    with pytest.raises(
        ConfigError, match=r"^target: no case .*; allowed: 1, 2, .*, new, ship, or a path"
    ) as error:
        load_case(name, world, key="target")
    assert "\n" not in str(error.value)


def test_a_folder_is_no_case(tmp_path: Path, world: World) -> None:
    (tmp_path / "mine.yaml").mkdir()
    with pytest.raises(ConfigError, match="no case"):
        load_case(str(tmp_path / "mine.yaml"), world)


@pytest.mark.parametrize("ending", ["yaml", "yml"])
def test_a_users_case_by_path(ending: str, tmp_path: Path, world: World) -> None:
    path = tmp_path / f"mine.{ending}"
    path.write_text(GOOD)
    case = load_case(str(path), world)
    assert case.name == "mine" and case.target_ships[0].y == 300.0


def test_whole_numbers_are_accepted(tmp_path: Path, world: World) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(GOOD.replace(".0", ""))
    case = load_case(str(path), world)
    assert case.goal == [0.0, 600.0] and isinstance(case.target_ships[0].speed, float)


def test_a_users_case_by_name(tmp_path: Path, world: World) -> None:
    folder = tmp_path / "conf" / "case"
    folder.mkdir(parents=True)
    (folder / "mine.yaml").write_text(GOOD)
    # The working directory's cases come before the shipped ones.
    (folder / "1.yaml").write_text(GOOD)
    (folder / "2.yaml").write_text((conf_dir() / "case" / "2.yaml").read_text())
    assert case_names() == sorted([*SHIPPED, "mine"])
    assert load_case("mine", world).target_ships and load_case("1", world).target_ships
    assert not load_case("3", world).target_ships[1:]
    # It is told of a case that is another one than the shipped one of its name.
    taken = {name for name in case_names() if shadowing_case(name)}
    assert taken == {"1"} and shadowing_case("1") == Path("conf/case/1.yaml")


def test_a_goal_at_the_end_of_the_last_step_is_reached(tmp_path: Path, world: World) -> None:
    path = tmp_path / "mine.yaml"
    # 60 steps of a second at 15 m/s, and 60 m from the goal is near enough.
    path.write_text(GOOD.replace("goal: [0.0, 600.0]", "goal: [0.0, 960.0]"))
    assert load_case(str(path), world).goal == [0.0, 960.0]
    path.write_text(GOOD.replace("goal: [0.0, 600.0]", "goal: [0.0, 961.0]"))
    with pytest.raises(ConfigError, match=r"901 m .* 60 steps \(world.max_steps\) of 1 s at up to 15 m/s"):
        load_case(str(path), world)


def test_a_ship_may_start_at_the_safe_distance(tmp_path: Path, world: World) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(with_ship(x="27.0", y="36.0"))
    assert load_case(str(path), world).target_ships[0].x == 27.0
