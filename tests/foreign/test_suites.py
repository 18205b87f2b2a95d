"""Files and folders of other tools as suites."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from ship_trl.config.bounds import KNOT, NAUTICAL_MILE
from ship_trl.config.errors import ConfigError
from ship_trl.config.types import OwnShip, Perturbation, Situations, Targets
from ship_trl.foreign.suites import is_foreign, load_suite, read_cases
from ship_trl.formats.maritime_schema import read_situation
from ship_trl.sim import cases
from ship_trl.sim.cases import RecordedShip, load_world, to_heading
from tests.command import ship_trl
from tests.formats.test_maritime_schema import path, ship, situation
from tests.formats.traffic import CROSSING, HEAD_ON, SLOW_CROSSING, danish, make, write

WORLD = load_world()
LENGTH = 0.3 * NAUTICAL_MILE / 45
OWN = ship(56, 11, sog=12, cog=0)


def save(path: Path, values: Any) -> str:
    path.write_text(json.dumps(values))
    return str(path)


def test_lengths_are_scaled_by_the_safe_distance_and_speeds_by_own_ships(tmp_path: Path) -> None:
    name = save(tmp_path / "one.json", situation(OWN, ship(56.05, 11, sog=6, cog=180)))
    suite = load_suite(name, WORLD)
    (case,) = suite.cases
    (target,) = case.target_ships
    assert suite.name == case.name == "one" and suite.is_fixed
    assert target.y == pytest.approx(0.05 * 111_343 / LENGTH, rel=1e-4) and target.speed == pytest.approx(7.5)
    assert (case.heading, target.heading) == (90, -90)
    assert case.scale is not None
    assert case.scale.describe(WORLD) == "45 m are 0.30 NM, a step 30 s, own ship 12.0 kn"


def test_another_safe_distance_is_another_scale(tmp_path: Path) -> None:
    name = save(tmp_path / "one.json", situation(OWN, ship(56.05, 11, sog=6, cog=180)))
    one, other = (load_suite(name, WORLD, reading=Situations(safe=safe)).case for safe in (0.3, 0.6))
    assert other.target_ships[0].y == pytest.approx(one.target_ships[0].y / 2)


def test_without_a_goal_it_lies_ahead_and_a_far_one_is_moved_nearer(tmp_path: Path) -> None:
    ahead = load_suite(save(tmp_path / "a.json", situation(ship(56, 11, sog=9, cog=90))), WORLD).case
    assert ahead.goal == pytest.approx([600, 0])
    far = path((56, 11), (57, 11), leg={"sog": 9})
    assert load_suite(save(tmp_path / "b.json", situation(far)), WORLD).case.goal == pytest.approx([0, 672])


def test_a_folder_is_a_suite_whose_refused_files_are_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for number in range(3):
        save(tmp_path / f"s{number}.json", situation(OWN, ship(56.05 + number / 100, 11, sog=6, cog=180)))
    save(tmp_path / "s3.json", situation(OWN, ship(56.001, 11, sog=6, cog=180)))
    save(tmp_path / "s4.json", {"a": 1})
    save(tmp_path / "s5.json", situation(OWN))
    suite = load_suite(str(tmp_path), WORLD)
    assert [case.name for case in suite.cases] == ["s0", "s1", "s2", "s5"]
    told = capsys.readouterr().err
    assert "a situation has no target ship (in s5.json)" in told
    assert "4 scenes, 2 refused: s3.json: target ship 1 starts 0.06 NM from own ship; allowed" in told
    assert "s4.json: has no ownShip; allowed: a traffic situation" in told


def test_scenes_of_one_name_are_numbered_and_a_broken_file_is_counted(tmp_path: Path) -> None:
    folder = tmp_path / "v1.2"
    folder.mkdir()
    for number, name in enumerate(("a b.json", "a_b.json", "a-b.json")):
        save(folder / name, situation(OWN, ship(56.05 + number / 100, 11, sog=6, cog=180)))
    (folder / "deep.yaml").write_text(f"ship_list: {'[' * 3000}")
    (folder / "deep.json").write_text(f'{{"ownShip": {"[" * 700}{"]" * 700}}}')
    report = read_cases(str(folder), WORLD)
    assert [case.name for case in report.cases] == ["a_b", "a-b", "a_b-2"]
    assert len(report.refused) == 2 and "nested too deeply" in report.refused[1]
    assert load_suite(f"{folder}/../v1.2/", WORLD).name == "v1.2"


def test_one_wrong_situation_of_a_list_is_counted_alone(tmp_path: Path) -> None:
    name = save(tmp_path / "list.json", [situation(OWN), {"ownShip": {}}, situation(OWN)])
    report = read_cases(name, WORLD)
    assert [case.name for case in report.cases] == ["list-1", "list-3"]
    assert (
        len(report.refused) == 1
        and f"{name}: [1]: ownShip.initial.position.lat: missing" in report.refused[0]
    )


def test_a_folder_does_not_hide_a_suite_of_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("imazu", "4", "mine"):
        Path(name).mkdir()
        save(Path(name) / "one.json", situation(OWN))
    assert [name for name in ("imazu", "4", "mine", "imazu/", "") if is_foreign(name)] == ["mine", "imazu/"]


def test_the_only_file_is_refused_in_a_line(tmp_path: Path) -> None:
    name = save(tmp_path / "a.json", situation(ship(95, 11, sog=1, cog=1)))
    with pytest.raises(ConfigError, match=r"a\.json: ownShip\.initial\.position\.lat: must be less than"):
        load_suite(name, WORLD)
    (tmp_path / "b.json").write_text("{")
    with pytest.raises(ConfigError, match=r"b\.json: "):
        load_suite(str(tmp_path / "b.json"), WORLD)


def test_a_table_of_positions_is_a_suite_with_recorded_tracks(tmp_path: Path) -> None:
    name = str(write(tmp_path / "day.csv", make(CROSSING), "danish"))
    report = read_cases(name, WORLD)
    (case,) = report.cases
    assert report.lines(WORLD)[-1].partition(";")[0] == "1 pair, 1 encounter, 1 scene, 0 refused"
    # 1,200 s of track at just above 30 s a step.
    assert len(case.track) == 39 and case.track[0] == pytest.approx((0, 15), abs=0.1)
    (replayed,) = load_suite(name, WORLD, reading=Situations(targets=Targets.replay)).case.target_ships
    assert isinstance(replayed, RecordedShip) and len(replayed.path) == 39
    assert replayed.number == 0


def test_exchanged_columns_and_no_positions_are_refused(tmp_path: Path) -> None:
    rows = make(CROSSING)
    swapped = danish(rows).rename(columns={"Latitude": "Longitude", "Longitude": "Latitude"})
    swapped.to_csv(tmp_path / "swapped.csv", index=False)
    with pytest.raises(ConfigError, match=r"swapped\.csv: .* are latitude and longitude swapped\?"):
        read_cases(str(tmp_path / "swapped.csv"), WORLD)
    danish(rows).assign(MMSI=1).to_csv(tmp_path / "buoys.csv", index=False)
    with pytest.raises(ConfigError, match=r"buoys\.csv: has no row of a ship with an MMSI"):
        read_cases(str(tmp_path / "buoys.csv"), WORLD)


def test_traffic_without_an_encounter_is_refused_with_what_one_is(tmp_path: Path) -> None:
    apart = [CROSSING[0], CROSSING[0]._replace(x=3000.0)]
    name = str(write(tmp_path / "quiet.csv", make(apart), "danish"))
    limit = "a DCPA below 0.40 NM in 15 minutes or less"
    with pytest.raises(ConfigError, match=f"has no encounter, which is {limit} .*; 1 pair, 0 encounters"):
        read_cases(name, WORLD)


def test_a_recorded_scene_is_the_same_alone_and_in_a_folder(tmp_path: Path) -> None:
    for name, tracks in (("a", CROSSING), ("b", HEAD_ON)):
        write(tmp_path / f"{name}.csv", make(tracks), "danish")
    reading = Situations(targets=Targets.replay)
    folder, alone = (load_suite(str(tmp_path / name), WORLD, reading=reading) for name in ("", "b.csv"))
    assert [case.fingerprint for case in alone.cases] == [case.fingerprint for case in folder.cases[1:]]
    assert len({case.fingerprint for case in folder.cases}) == len(folder.cases) > 1


def test_one_scene_of_a_file_can_be_chosen(tmp_path: Path) -> None:
    name, own = str(write(tmp_path / "day.csv", make(HEAD_ON), "danish")), Situations()
    first, second = load_suite(name, WORLD).cases
    (chosen,) = load_suite(name, WORLD, reading=replace(own, scene=second.name)).cases
    assert chosen.fingerprint == second.fingerprint != first.fingerprint
    with pytest.raises(
        ConfigError, match=rf"situations\.scene: .* has no scene none; allowed: {first.name}, "
    ):
        load_suite(name, WORLD, reading=replace(own, scene="none"))


def test_an_encounter_of_a_slow_own_ship_and_one_seen_late_are_told(tmp_path: Path) -> None:
    late = CROSSING[0], CROSSING[1]._replace(x=741, y=741)
    away = [
        track._replace(y=track.y - metres)
        for metres, tracks in ((30_000, SLOW_CROSSING), (60_000, late))
        for track in tracks
    ]
    tracks = (*CROSSING, *away)
    report = read_cases(str(write(tmp_path / "day.csv", make(tracks), "danish")), WORLD)
    line, _, _ = report.lines(WORLD)[-1].partition(";")
    assert line == (
        "3 pairs, 3 encounters, 1 whose own ship makes less than 3 knots, "
        "1 seen less than 4 minutes before CPA, 1 scene, 0 refused"
    )


def test_recorded_ships_are_not_perturbed(tmp_path: Path) -> None:
    name = str(write(tmp_path / "day.csv", make(CROSSING), "danish"))
    replay, moved = Situations(targets=Targets.replay), Perturbation(ship_position=5)
    with pytest.raises(ConfigError, match="perturbation: recorded ships start where their tracks do"):
        load_suite(name, WORLD, perturbation=moved, reading=replay)
    assert load_suite(name, WORLD, perturbation=moved).is_drawn


def test_scenarios_of_ntnu_are_told_from_cases_by_content(tmp_path: Path) -> None:
    scenario, case = tmp_path / "a.yaml", tmp_path / "b.yaml"
    scenario.write_text("ship_list:\n- csog_state: [0, 0, 10.0, 0]\n- csog_state: [9000, 0, 10.0, 180]\n")
    case.write_text((Path(cases.__file__).parents[2] / "conf/case/4.yaml").read_text())
    assert is_foreign(str(scenario)) and not is_foreign(str(case)) and not is_foreign("4")
    assert load_suite(str(scenario), WORLD).case.target_ships[0].speed == 15


def test_own_cases_and_suites_are_what_they_were() -> None:
    for name in ("4", "imazu", "traffic_test"):
        assert load_suite(name, WORLD).fingerprint == cases.load_suite(name, WORLD).fingerprint


def test_a_folder_of_situations_is_evaluated_by_the_real_command(tmp_path: Path) -> None:
    folder = tmp_path / "situations"
    folder.mkdir()
    for number in range(2):
        save(folder / f"s{number}.json", situation(OWN, ship(56.06, 11 + number / 100, sog=12, cog=180)))
    told = ship_trl(
        "vo", "keep_course", f"target={folder}", "situations.safe=0.2", folder=tmp_path, verb="evaluate"
    )
    assert "situations: 2 episodes" in told.stdout and "2 scenes, 0 refused" in told.stderr


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (("target=a.csv",), "ship_trl: a.csv: has no column for time, mmsi, latitude, longitude, sog, cog; "),
        (("target=4", "situations.safe=0"), "ship_trl: situations.safe: "),
        (("target=a.csv", "situations.own=me"), "ship_trl: situations.own: "),
    ],
)
def test_wrong_words_are_refused_by_the_real_command(
    words: tuple[str, ...], line: str, tmp_path: Path
) -> None:
    (tmp_path / "a.csv").write_text("a,b\n1,2\n")
    told = ship_trl("vo", *words, folder=tmp_path, verb="evaluate", code=1)
    assert told.stderr.startswith(line) and told.stderr.count("\n") == 1


def test_an_episode_is_written_for_other_tools_and_read_again(tmp_path: Path) -> None:
    save(tmp_path / "one.json", situation(OWN, ship(56.06, 11.02, sog=11, cog=200)))
    files = "--situation", "out_one.json", "--ais", "out_one.csv"
    ship_trl("keep_course", "target=one.json", *files, folder=tmp_path, verb="record")
    given, found = (
        read_situation(json.loads((tmp_path / name).read_text()), "one")
        for name in ("one.json", "out_one.json")
    )
    for one, other in zip((given.own, *given.targets), (found.own, *found.targets), strict=True):
        assert math.dist((one.x, one.y), (other.x, other.y)) < 1
        assert (one.course, one.speed) == pytest.approx((other.course, other.speed), abs=0.02)
    (again, _) = read_cases(str(tmp_path / "out_one.csv"), WORLD, Situations(own=OwnShip.both)).cases
    assert again.scale is not None and 15 * again.scale.speed == pytest.approx(12 * KNOT, abs=0.05 * KNOT)
    assert again.target_ships[0].heading == pytest.approx(to_heading(200), abs=0.1)
    told = ship_trl("vo", "keep_course", "target=one.json", *files, folder=tmp_path, verb="record", code=1)
    assert "--situation, --ais: one episode, got 2" in told.stderr
