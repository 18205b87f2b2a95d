"""What a study may be asked to be, and every wrong value refused in one line."""

import pytest

from ship_trl.config.arm import Arm
from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import conf_files
from ship_trl.study.plan import (
    CONTROL_ARMS,
    CONTROL_PAIRS,
    FIRST_BLOCK_ARMS,
    FIRST_BLOCK_PAIRS,
    to_study,
)
from tests.config.test_config import composed


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("profile=endless", "profile: no endless; allowed: long, paper, quick, smoke"),
        ("pairs=[high,highest]", "pairs: no highest; allowed: high, low"),
        ("arms=[FE3,FE3]", "arms: must be at least one name, each once, got FE3, FE3"),
        ("seeds=1", "seeds: must be greater than or equal to 2, got 1"),
        ("launcher=condor", "launcher: no condor; allowed: joblib"),
        ("overrides=[seed=3]", "overrides: seed differs between runs; allowed: what all runs share"),
        ("overrides=[perturbation.own_position=5]", "overrides: perturbation: a study compares with"),
        ("overrides=[learn.epsilon_start=0.5]", "overrides: learn.epsilon_start differs"),
        ("arms=scratch,FE3", "arms: must be a valid list, got"),
        ("pairs=[high,", "pairs=[high,: cannot be read; a list is written without spaces"),
        ("controls=true arms=[FTW,FE3-random]", "arms: FE3-random is one of the controls; allowed: contr"),
        ("sseds=3", "sseds: unknown key; allowed here: question, profile, seeds"),
        ("reuse=true pairs=[low]", "reuse: needs pair high with arm FTW"),
        ("\x1b[31m=3", "\\x1b: unknown key"),
    ],
)
def test_what_is_wrong_is_said(override: str, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        to_study(override.split(" "))
    assert said in str(caught.value) and "\n" not in str(caught.value)


def test_a_launcher_that_is_not_there_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ship_trl.study.plan.find_spec", lambda name: None)
    with pytest.raises(
        ConfigError, match=r"launcher: ray_cluster is not installed; run: pip install -e '.\[ray\]'"
    ):
        to_study(["launcher=ray_cluster"])


def test_slurm_is_looked_for_before_anything_is_started(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ship_trl.grid.launchers.shutil.which", lambda _: None)
    with pytest.raises(
        ConfigError, match=r"^launcher: slurm needs sbatch, which is not found here; allowed: sl"
    ):
        to_study(["launcher=slurm"])
    assert to_study(["launcher=slurm_local"]).launcher == "slurm_local"


def test_every_control_composes_and_says_what_it_is() -> None:
    for arm in (*CONTROL_ARMS, *FIRST_BLOCK_ARMS):
        assert composed("+pair=low", f"+arm={arm}").arm.name == arm
    for pair, arms in (*CONTROL_PAIRS.items(), *FIRST_BLOCK_PAIRS.items()):
        assert [Arm.parse(arm).name for arm in arms] == list(arms) and pair in conf_files("pair")
