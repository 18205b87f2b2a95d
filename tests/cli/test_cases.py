"""The command that shows the cases: Table 2, a picture, and which source a target should take."""

import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from ship_trl.cli.cases import main, show_ranking
from ship_trl.sim.cases import load_case, load_suite, load_world
from ship_trl.transfer.casebase import CaseBase
from tests.command import ROOT, ship_trl
from tests.pasted import composed_values, printed_commands


def test_cases_command_recommends_a_source(tmp_path: Path) -> None:
    done = ship_trl("target=new", folder=tmp_path, verb="cases")
    line = "python -m ship_trl source=2 target=new method=feature_extraction layers=3"
    assert line in done.stdout.splitlines()
    with Image.open(tmp_path / "outputs/case_new.png") as picture:
        assert picture.width < 800  # of this case alone
    assert not (tmp_path / "outputs/cases.png").exists()
    # Of the bundled networks, the one that returns most there.
    asked = next(line for line in done.stdout.splitlines() if line.startswith("By zero_shot"))
    assert "the largest of 7 bundled networks" in asked
    best = r"python -m ship_trl source=\w+ source_weights=pretrained target=new \+arm=FTW"
    assert re.search(best, done.stdout)
    case, place = load_suite("2", load_world()), tmp_path / "run"
    place.mkdir()
    for name in ("policy.safetensors", "config.yaml"):
        (place / name).write_text("")
    base = CaseBase(tmp_path / "a base")
    base.retain(case, "FTW-from-1", 3, "abc", {"best": {"return": 80.0}}, place)
    done = ship_trl("target=new", "--case-base", "a base", folder=tmp_path, verb="cases")
    policy = "a base/2/FTW-from-1/seed=3-abc/policy.safetensors"
    stored = next(one for one in printed_commands(done.stdout) if "source_file" in one)
    assert composed_values(stored) == composed_values(line) | {"source_file": policy}
    assert "(FTW-from-1, seed 3, greedy return 80.0)" in done.stdout
    done = ship_trl("target=banana", folder=tmp_path, verb="cases", code=1)
    assert done.stderr.startswith("ship_trl: target: no case or suite banana; allowed: 1, 2")
    assert done.stderr.count("\n") == 1


def test_random_encounters_are_shown_by_their_seeds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = tmp_path / "traffic.png"
    main(["target=traffic", "--picture", str(picture)])
    assert "scenes of the seeds 0 to 19" in capsys.readouterr().out
    with Image.open(picture) as image:
        assert image.width == 1180
    with pytest.raises(SystemExit):
        main(["target=traffic,paper"])
    assert "target: must be alone, where it is a suite of random encounters" in capsys.readouterr().err


def test_recommended_commands_keep_odd_names(tmp_path: Path) -> None:
    folder = tmp_path / "conf" / "case"
    folder.mkdir(parents=True)
    shutil.copy(ROOT / "conf" / "case" / "2.yaml", folder / "münchen.yaml")
    done = ship_trl("target=münchen", folder=tmp_path, verb="cases")
    lines = printed_commands(done.stdout)
    assert lines and {composed_values(line)["target"] for line in lines} == {"münchen"}
    # A case that was given by its path is no name.
    shutil.copy(ROOT / "conf" / "case" / "2.yaml", tmp_path / "own.yaml")
    lines = printed_commands(ship_trl("target=own.yaml", folder=tmp_path, verb="cases").stdout)
    assert lines and {composed_values(line)["target"] for line in lines} == {"own.yaml"}


def test_no_source_is_recommended_where_none_is_similar(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    world = load_world()
    # What an encounter of another tool has: nobody knows the ideal path.
    sources = [replace(load_case(name, world), ideal_path=f"path {name}") for name in ("1", "2")]
    target = replace(load_case("4", world), ideal_path="unknown", target_ships=[], name="foreign")
    show_ranking(target, ["target=foreign"], sources[1:], world, "similarity", CaseBase(tmp_path))
    assert "By the paper's rule: no case is similar to case foreign.\n" in capsys.readouterr().out
