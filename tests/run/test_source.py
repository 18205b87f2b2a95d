"""Which of a source file's weights a run reads."""

from collections.abc import Sequence
from pathlib import Path

import pytest
from hydra import compose, initialize_config_dir

from ship_trl.config.checks import to_config
from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import conf_dir
from ship_trl.policies.pretrained import networks
from ship_trl.run.plan import make_run
from ship_trl.run.setup import Source, read_source

ACTIONS = "world.actions=[[15,0],[7.5,0.1],[7.5,-0.1]]"


def read(arm: str, folder: Path, world: Sequence[str] = (ACTIONS,)) -> Source | None:
    """Read a source of seven actions, for a world of three by default."""
    file = next(one.file for one in networks() if one.name == "1")
    words = ("source=1", "target=2", f"+arm={arm}", f"source_file={file}", f"output={folder}", *world)
    with initialize_config_dir(str(conf_dir()), version_base="1.3"):
        return read_source(make_run(to_config(compose("config", list(words)))))


@pytest.mark.parametrize("arm", ["FE3", "FT1", "FTB", "SP3", "GU3"])
def test_a_source_may_have_other_actions_where_its_output_is_not_copied(arm: str, tmp_path: Path) -> None:
    found = read(arm, tmp_path)
    assert found is not None
    assert {key.split(".")[0] for key in found.weights} == {
        "conv1",
        "conv2",
        "conv3",
        "conv4",
        "shared",
        "value",
    }


@pytest.mark.parametrize("arm", ["FTW", "FTH", "G3", "QD"])
def test_a_source_of_other_actions_is_refused_where_its_q_values_are_needed(arm: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"advantage\.bias has shape \(7,\), allowed \(3,\)"):
        read(arm, tmp_path)
