"""A grid is checked whole before its first run begins."""

import shutil
from pathlib import Path

import pytest

from tests.command import SMOKE, ship_trl

# In one process, which imports torch only once.
BASIC = "hydra/launcher=basic"
SCRATCH = ("-m", *SMOKE, "target=1", "method=scratch")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["seed=0,-1"], "seed: must be greater than or equal to 0, got -1"),
        (["learn.lr=0.001,abc"], "learn.lr: must be a valid number, got"),
        (
            ["learn.lr=0.001,0.002", "learn.tau=0.1,0.2"],
            "/1/scratch/seed=0; allowed: 'output=outputs/${learn.lr}-${learn.tau}', or a grid for each value",
        ),
        (
            ["network=paper,five"],
            "/1/scratch/seed=0; allowed: a grid for each value, with its own output",
        ),
        (["learn.lr=0.1", "++learn.lr=0.2"], "learn.lr: given twice; allowed: once in a grid"),
    ],
    ids=lambda value: value[0] if isinstance(value, list) else "",
)
def test_a_wrong_run_is_refused_before_any_begins(words: list[str], said: str, tmp_path: Path) -> None:
    others = (word for word in SCRATCH if word.split("=")[0] not in [one.split("=")[0] for one in words])
    done = ship_trl(*others, *words, folder=tmp_path, code=1)
    assert done.stderr.startswith("ship_trl: ") and said in done.stderr
    assert done.stderr.count("\n") == 1 and not done.stdout and not list(tmp_path.iterdir())


@pytest.mark.skipif(shutil.which("sbatch") is not None, reason="there is a cluster")
def test_without_a_cluster_its_launcher_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("hydra_plugins.hydra_submitit_launcher")
    done = ship_trl(*SCRATCH, "hydra/launcher=slurm", folder=tmp_path, code=1)
    assert done.stderr.startswith("ship_trl: hydra/launcher: slurm needs sbatch, which is not found here")
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_settings_of_a_grid_may_name_its_folders(tmp_path: Path) -> None:
    done = ship_trl(*SCRATCH, BASIC, "learn.tau=0.1,0.2", "output=runs/${learn.tau}", folder=tmp_path)
    assert "compare the runs: python -m ship_trl results runs\n" in done.stderr + done.stdout
    found = {str(path.relative_to(tmp_path)) for path in tmp_path.rglob("result.json")}
    assert found == {f"runs/{tau}/1/scratch/seed=0/result.json" for tau in ("0.1", "0.2")}
