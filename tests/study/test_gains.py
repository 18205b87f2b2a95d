"""What could be gained, on runs whose gains are known."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from ship_trl.study.gains import main
from tests.study.synthetic import write_run

# Scores of 100 episodes: at 0.2, then from an episode on at 0.9.
EPISODES, LOW, HIGH = 100, 0.2, 0.9


def write(folder: Path, case: str, seed: int, rises: int) -> None:
    scores = np.where(np.arange(EPISODES) < rises, LOW, HIGH)
    write_run(folder, scores, pair=case, arm="scratch", seed=seed, target=case, before=LOW)


def test_gains_are_means_over_the_seeds_that_both_have(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scratch, knowing = tmp_path / "scratch", tmp_path / "knowing"
    for seed, rises in ((0, 60), (1, 40), (2, 90)):
        write(scratch, "2", seed, rises)
    for seed, rises in ((0, 30), (1, 30)):
        write(knowing, "2", seed, rises)
    main([str(scratch), str(knowing)])
    out = capsys.readouterr().out
    assert out.startswith("# case 2: 2 seeds\n")
    found = yaml.safe_load(out)["gains"]
    # 30 and 10 of 100 episodes earlier; in the first fifth and last tenth they are alike.
    assert found["2"]["area"] == pytest.approx(0.2 * (HIGH - LOW))
    assert found["2"]["time"] == pytest.approx(0.2)
    assert not {"asymptote", "early area", "start"} & set(found["2"])


def test_the_whole_dip_of_scratch_could_be_gained(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    # It learns late and never falls; the exploration rate of these runs is at its end from the start.
    scores = np.full(EPISODES, HIGH)
    scores[:10] = LOW
    write_run(tmp_path / "scratch", scores, pair="4", target="4")
    write_run(tmp_path / "knowing", np.full(EPISODES, HIGH), pair="4", target="4")
    main([str(tmp_path / "scratch"), str(tmp_path / "knowing")])
    found = yaml.safe_load(capsys.readouterr().out)["gains"]
    assert "dip" not in found["4"] and found["4"]["early area"] == pytest.approx(0.5 * (HIGH - LOW))
    scores[:10], scores[10:20] = HIGH, LOW
    write_run(tmp_path / "falls", scores, pair="4", target="4")
    main([str(tmp_path / "falls"), str(tmp_path / "knowing")])
    found = yaml.safe_load(capsys.readouterr().out)["gains"]
    assert found["4"]["dip"] == pytest.approx(HIGH - LOW)


def test_what_is_wrong_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scratch, knowing, broken = (tmp_path / name for name in ("scratch", "knowing", "broken"))
    write(scratch, "2", 0, 50)
    write(knowing, "2", 1, 50)
    write(broken, "2", 0, 50)
    (broken / "2" / "scratch" / "seed=0" / "curve.csv").write_text("episode\n")
    twice = tmp_path / "twice"
    write(twice / "a", "2", 0, 50)
    write(twice / "b", "2", 0, 50)
    for folders, said in (
        ((scratch, knowing), "SCRATCH and KNOWING have no case and seed in common"),
        ((scratch, tmp_path / "nowhere"), f"{tmp_path / 'nowhere'}: no finished run below it"),
        ((broken, knowing), f"{broken / '2' / 'scratch' / 'seed=0'}: curve.csv"),
        ((twice, knowing), "of the same case and seed as"),
    ):
        with pytest.raises(SystemExit) as ended:
            main([str(folder) for folder in folders])
        assert ended.value.code == 1
        error = capsys.readouterr().err
        assert said in error and error.count("\n") == 1
