"""The command that shows the cases: Table 2, a picture, and which source a target should take."""

import re
import shutil
from pathlib import Path

import pytest
from PIL import Image

from ship_trl.cli.cases import Candidate, main, recommend
from ship_trl.config.errors import override
from ship_trl.policies.pretrained import NETWORKS
from ship_trl.sim.cases import load_case, load_suite, load_world
from ship_trl.transfer.casebase import CaseBase
from ship_trl.transfer.law import Expected
from tests.command import ROOT, ship_trl
from tests.pasted import composed_values, printed_commands


def test_cases_command_recommends_a_source(tmp_path: Path) -> None:
    case, place = load_suite("imazu07", load_world()), tmp_path / "run"
    place.mkdir()
    shutil.copy(NETWORKS / "5.safetensors", place / "policy.safetensors")
    (place / "config.yaml").write_text("")
    base = CaseBase(tmp_path / "a base")
    base.retain(case, "FTW-from-1", 3, "abc", {"best": {"return": 80.0}}, place)
    done = ship_trl("target=new", "--case-base", "a base", folder=tmp_path, verb="cases")
    lines = done.stdout.splitlines()
    # Of all sources the largest expected gain, and nothing else.
    (line,) = printed_commands(done.stdout)
    assert line == "python -m ship_trl source=2 source_weights=pretrained target=new +arm=FTW"
    first = next(row.split() for row in lines if row.startswith("2 "))
    (said,) = (row for row in lines if row.startswith("Recommended"))
    words = rf"whole network \(FTW\) of case 2: expected gain \{first[1]} \([+-]0.\d\d to [+-]0.\d\d in nine"
    assert re.search(words, said)
    why = next(row for row in lines if row.startswith("Why: "))
    assert sum(map(float, re.findall(r"[+-]\d\.\d\d", why))) == pytest.approx(float(first[1]), abs=0.021)
    assert next(row for row in lines if row.startswith("imazu07 ")).split()[-1] == "stored"
    gains = [float(row.split()[1]) for row in lines[3 : lines.index("")]]
    assert len(gains) == 12 and gains == sorted(gains, reverse=True)
    with Image.open(tmp_path / "outputs/case_new.png") as picture:
        assert picture.width < 800  # of this case alone
    assert not (tmp_path / "outputs/cases.png").exists()
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


@pytest.mark.parametrize("gains", [(-0.1, -0.2), ()])
def test_scratch_is_recommended_where_nothing_helps(
    gains: tuple[float, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    world = load_world()
    measured = {"similarity": 0.1, "distance": 0.2}
    found = [
        Candidate(
            load_case("1", world), Expected(gain, gain - 0.2, gain + 0.2, *4 * [0.0]), measured, None, "", ()
        )
        for gain in gains
    ]
    recommend(load_case("4", world), ["target=4"], found, [])
    said = capsys.readouterr().out
    assert said.startswith("Recommended for case 4: learn from scratch")
    assert printed_commands(said) == ["python -m ship_trl target=4 method=scratch"]


def test_a_stored_network_is_named_in_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    world = load_world()
    words = (override("source_file", Path("a base/policy.safetensors")),)
    expected = Expected(0.1, -0.1, 0.3, *4 * [0.0])
    measured = {"similarity": 0.1, "distance": 0.2}
    found = [Candidate(load_case("1", world), expected, measured, 0.5, "stored", words)]
    recommend(load_case("4", world), ["target=4"], found, [])
    said = capsys.readouterr().out
    assert "it may also harm" in said
    (line,) = printed_commands(said)
    wanted = {"source": "1", "source_file": "a base/policy.safetensors", "target": "4", "arm": "FTW"}
    assert composed_values(line) == wanted
