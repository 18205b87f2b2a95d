"""The real commands in a process of their own."""

import csv
import json
import pickle
import shutil
import signal
from pathlib import Path

import pytest
import torch
from safetensors.torch import load_file
from torch import Generator

from ship_trl.cli.errors import refusals
from ship_trl.config.types import BFLOAT16, Precision
from ship_trl.learn.network import DuelingNetwork, choose_dtype
from ship_trl.run.plan import make_run
from ship_trl.run.process import StoppedError
from ship_trl.transfer.weights import permute_values
from tests.command import SMOKE, contents, files, ship_trl
from tests.config.test_config import composed

HIGH = (*SMOKE, "+pair=high")
FINETUNE = (*HIGH, "method=finetune", "layers=3")


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the main command was run once, at smoke size."""
    folder = tmp_path_factory.mktemp("trained")
    done = ship_trl(*FINETUNE, folder=folder, pictures=True)
    assert "case 1 -> case 2, FT3, seed 0, profile smoke\n" in done.stdout
    return folder


def test_main_command_leaves_a_whole_result(trained: Path) -> None:
    outputs = trained / "outputs/smoke"
    for run in ("1/scratch/seed=0", "high/FT3/seed=0"):
        assert sorted(p.name for p in (outputs / run).iterdir()) == [
            "checkpoint.safetensors", "config.yaml", "curve.csv", "curve.png", "episode.gif",
            "policy.safetensors", "policy_last.safetensors", "result.json",
        ]  # fmt: skip
    result = json.loads((outputs / "high/FT3/seed=0/result.json").read_text())
    assert (result["arm"], result["source"], result["target"], result["episodes"]) == ("FT3", "1", "2", 3)
    assert result["best_known_return"] == pytest.approx(83.9, abs=0.01)
    assert f"torch.{result['precision']}" == str(choose_dtype(Precision.auto, torch.device("cpu")))
    assert result["backend"] == "incremental"
    with (outputs / "high/FT3/seed=0/curve.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(r["episode"]) for r in rows if r["return"]] == [1, 2, 3]
    greedy = {int(r["episode"]): float(r["greedy_return"]) for r in rows if r["greedy_return"]}
    assert list(greedy) == [0, 3]
    assert result["best"]["return"] == max(greedy.values()) == greedy[result["best"]["episode"]]
    assert result["final"]["return"] == greedy[3] and result["before"]["return"] == greedy[0]
    assert len(result["draws"]) == 1
    hidden = {p.name for p in trained.rglob(".*")}
    assert hidden <= {".locks", ".plans"}  # no half-made entry is left


def test_finished_run_is_shown_not_trained_again(trained: Path) -> None:
    before = files(trained / "outputs/smoke/high/FT3")
    done = ship_trl(*FINETUNE, folder=trained)
    assert "is already finished" in done.stdout
    assert files(trained / "outputs/smoke/high/FT3") == before


def test_same_seed_same_bytes(trained: Path, tmp_path: Path) -> None:
    ship_trl(*FINETUNE, folder=tmp_path, pictures=True)
    mine, other = (contents(folder / "outputs/smoke") for folder in (trained, tmp_path))
    run = "high/FT3/seed=0"
    assert {
        f"{run}/{name}" for name in ("curve.csv", "curve.png", "episode.gif", "result.json")
    } < mine.keys()
    # Other tests add runs to the first folder.
    assert [name for name, data in other.items() if mine.get(name) != data] == []


@pytest.mark.parametrize("switch", ["on", "off"])
def test_frozen_layers_are_the_source_s_bytes(
    switch: str, trained: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(BFLOAT16, switch)
    base = next((trained / "outputs/smoke/case_base/1/scratch").iterdir()) / "policy.safetensors"
    copy = shutil.copy(base, trained / "source.safetensors")
    ship_trl(*HIGH, "+arm=FE3", "source_file=source.safetensors", f"output=bf16_{switch}", folder=trained)
    run = trained / f"bf16_{switch}" / "high/FE3/seed=0"
    precision = json.loads((run / "result.json").read_text())["precision"]
    assert f"torch.{precision}" == str(choose_dtype(Precision.auto, torch.device("cpu")))
    last = run / "policy_last.safetensors"
    target = load_file(last)
    for key, value in load_file(copy).items():
        assert torch.equal(value, target[key]) == key.startswith(("conv1", "conv2", "conv3")), key


@pytest.mark.parametrize("weights", ["random", "permuted"])
def test_a_control_copies_and_freezes_random_or_permuted_weights(weights: str, trained: Path) -> None:
    line = (*HIGH, f"+arm=FE2-{weights}")
    ship_trl(*line, folder=trained)
    folder = trained / f"outputs/smoke/high/FE2-{weights}/seed=0"
    source = json.loads((folder / "result.json").read_text())["source_network"]
    generator = Generator().manual_seed(make_run(composed(*line)).stream(f"{weights} source"))
    if weights == "random":
        assert source == "random"
        copied = dict(DuelingNetwork(1, 7, generator).state_dict())
    else:
        assert (trained / source).parent.parent.name == "scratch"  # of the case base
        copied = dict(permute_values(load_file(trained / source), generator))
    for key, value in load_file(folder / "policy_last.safetensors").items():
        assert torch.equal(value, copied[key]) == key.startswith(("conv1", "conv2")), key


def test_a_grid_runs_every_job_and_tells_which_was_refused(trained: Path) -> None:
    # Trained with other settings, so that its folder is taken.
    taken = trained / "outputs/smoke/1/scratch/seed=0"
    before = files(taken)
    # In this process, which has imported torch.
    grid = ("-m", "hydra.launcher.n_jobs=1", *SMOKE, "target=1", "method=scratch", "learn.gamma=0.5")
    done = ship_trl(*grid, "seed=0,1", folder=trained, code=1)
    assert "seed=0 holds a finished run of other settings" in done.stderr
    assert "Traceback" not in done.stderr and files(taken) == before
    assert (trained / "outputs/smoke/1/scratch/seed=1/result.json").is_file()


@pytest.mark.long
def test_a_grid_uses_all_cores_and_trains_a_source_once(tmp_path: Path) -> None:
    done = ship_trl("-m", *HIGH, "+arm=FE3,FT3", folder=tmp_path)
    assert "Joblib" in done.stdout
    lines = done.stdout.splitlines()
    assert sum(line.endswith(" of 2: case 1, scratch, seed 0, profile smoke") for line in lines) == 1
    for place, arm in enumerate(("FE3", "FT3"), 1):
        assert f"{place} of 2: case 1 -> case 2, {arm}, seed 0: best" in done.stdout
        assert (tmp_path / f"outputs/smoke/high/{arm}/seed=0/result.json").is_file()
    assert len(list((tmp_path / "outputs/smoke/case_base/1/scratch").glob("seed=0-*"))) == 1


REFUSED = {
    "target=1 method=scratch ~network.conv.0": "overrides: Hydra cannot read them (",
    "": "pair: none given",
    "-m +pair=high arm=glob(FE*)": "arm: no glob(FE*); allowed: scratch, or FE, FT",
    "watches target=4": "watches: no such verb; allowed: watch, record, play,",
    "--config-dir=gone target=1 method=scratch": "--config-dir: no folder ",
    "--config-dir=broken target=1 method=scratch network=broken": "config: not YAML: while parsing",
    "+pair=high layers=3 device=cuda": "device: no CUDA device",
    "target=broken.yaml method=scratch": "broken.yaml: goal: missing",
    "+pair=high layers=3 source_file=pickle.safetensors": "source_file: pickle.safetensors is not a whole",
}


@pytest.mark.parametrize("line", REFUSED)
def test_bad_input_is_one_line_and_leaves_everything(line: str, tmp_path: Path) -> None:
    if "device=cuda" in line and torch.cuda.is_available():
        line = "+pair=high layers=3 device=cuda:99"
    (tmp_path / "taken").write_text("mine")
    (tmp_path / "pickle.safetensors").write_bytes(pickle.dumps({"conv1.weight": 1}))
    (tmp_path / "broken/network").mkdir(parents=True)
    (tmp_path / "broken/network/broken.yaml").write_text("conv: [[8, 8, 4]\nhidden: 3\n")
    (tmp_path / "broken.yaml").write_text(
        "start: [0.0, 0.0]\nheading: 90.0\nideal_path: any\ntarget_ships: []\n"
    )
    before = files(tmp_path)
    done = ship_trl(*line.split(), folder=tmp_path, code=1)
    assert done.stdout == ""
    assert done.stderr.startswith(f"ship_trl: {REFUSED[line]}")
    assert done.stderr.count("\n") == 1
    assert files(tmp_path) == before


@pytest.mark.parametrize("flags", [["--multirum", "target=1"], ["--config-dir"]])
def test_an_unknown_flag_is_one_line(flags: list[str], tmp_path: Path) -> None:
    said = ship_trl(*flags, folder=tmp_path, code=1).stderr
    assert said.startswith("ship_trl: ") and said.count("\n") == 1 and "without dashes" in said
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("raised", "told"),
    [(KeyboardInterrupt(), "interrupted"), (StoppedError("stopped at 7", signal.SIGINT), "stopped at 7")],
)
def test_an_interrupt_is_one_line(
    raised: KeyboardInterrupt, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended, refusals():
        raise raised
    assert (ended.value.code, capsys.readouterr().err) == (130, f"ship_trl: {told}\n")
