"""`python -m ship_trl explain`: the page, its figures and tables, of networks that were really trained."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
from PIL import Image
from torch import Generator

from ship_trl.cli.explain import choose_entries, main
from ship_trl.config.network import load_network
from ship_trl.explain.networks import load_subjects, untrained
from ship_trl.learn.network import DuelingNetwork
from ship_trl.transfer.layers import save_weights
from tests.command import ROOT, ship_trl

# The paper's layers with few filters, so that a page takes seconds.
SMALL = "conv: [[8, 8, 4], [8, 4, 2], [8, 3, 1], [20, 7, 1]]\nhidden: 20\n"
SMOKE = (
    "profile=smoke",
    "learn.episodes=3",
    "learn.warmup_steps=30",
    "learn.jumpstart_draws=0",
    "output=runs",
)
WORDS = (
    *("runs/high/FE2/seed=0", "runs/1/scratch/seed=0", "target=2"),
    *("--episodes", "60", "--output", "page"),
)
FIGURES = {"probes", "change", "matrix", "erased", "saliency", "filters", "maps", "states"}
TABLES = {"probes", "cka", "layers", "erased", "saliency", "filters", "maps", "states"}


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("explain")
    (folder / "own" / "network").mkdir(parents=True)
    (folder / "own" / "network" / "small.yaml").write_text(SMALL)
    line = ("--config-dir", "own", "network=small", "+pair=high", "method=feature_extraction", "layers=2")
    ship_trl(*line, *SMOKE, folder=folder)
    return folder


@pytest.fixture(scope="module")
def page(trained: Path) -> Path:
    done = ship_trl(*WORDS, verb="explain", folder=trained)
    assert "probes 7 of 7" in done.stdout and "page/index.html" in done.stdout and done.stderr == ""
    return trained / "page"


def test_everything_is_written(page: Path) -> None:
    assert {path.stem for path in page.glob("*.png")} == FIGURES
    assert {path.stem for path in page.glob("*.csv")} == TABLES
    assert {path.suffix for path in page.iterdir()} == {".png", ".csv", ".html"}
    for path in page.glob("*.png"):
        with Image.open(path) as picture:
            assert picture.width == 1800 and picture.getextrema() != ((255, 255),) * 4
    html = (page / "index.html").read_text()
    assert html.count("data:image/png;base64,") == len(FIGURES)
    assert "http://" not in html and "https://" not in html
    assert "conv1 and conv2 were copied and frozen" in html


def test_layers_that_were_frozen_are_alike_and_the_others_are_not(page: Path) -> None:
    rows = pd.read_csv(page / "cka.csv")
    mine = rows[(rows.first_role == "explained") & (rows.second_role == "before training")].set_index("layer")
    assert mine.cka[["conv1", "conv2"]].tolist() == pytest.approx([1, 1])
    source = rows[(rows.first_role == "before training") & (rows.second_role == "source")].set_index("layer")
    assert source.cka[["conv1", "conv2"]].tolist() == pytest.approx([1, 1])
    assert source.cka["conv4"] < 0.99
    changed = pd.read_csv(page / "layers.csv").query("role == 'explained'").set_index("layer").changed
    assert changed[["conv1", "conv2"]].tolist() == [0, 0] and changed["conv4"] > 0


def test_shuffled_labels_are_not_read(page: Path) -> None:
    rows = pd.read_csv(page / "probes.csv")
    assert rows.shuffled_r2.max() < 0.2 and rows.r2.max() > 0.5
    assert ((rows.r2_low <= rows.r2) & (rows.r2 <= rows.r2_high)).all()


def test_of_a_file_alone_there_is_a_page_too(
    trained: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    alone = tmp_path / "alone.safetensors"
    shutil.copyfile(trained / "runs" / "high" / "FE2" / "seed=0" / "policy.safetensors", alone)
    main([str(alone), "target=1", "--episodes", "60", "--seed", "3"])
    assert "Not known: the first network is a file" in capsys.readouterr().out
    assert (tmp_path / "outputs" / "explain" / "index.html").is_file()


def test_a_source_that_is_gone_is_named(
    trained: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # The source is named relative to where the run was started.
    monkeypatch.chdir(trained)
    run = trained / "runs" / "high" / "FE2" / "seed=0"
    (whole,) = load_subjects(choose_entries([str(run)], False))
    assert whole.source is not None and whole.before is not None and whole.copied == ("conv1", "conv2")
    moved = tmp_path / "moved"
    shutil.copytree(run, moved)
    result = json.loads((moved / "result.json").read_text())
    for changes, said in (
        ({"source_network": "gone.safetensors"}, "source_file: no file gone.safetensors; a safetensors file"),
        ({"before": result["before"] | {"return": 1.0}}, "it should return 1.0 and returns "),
    ):
        (moved / "result.json").write_text(json.dumps(result | changes))
        (found,) = load_subjects(choose_entries([str(moved)], False))
        assert found.before is None
        told = capsys.readouterr().err
        assert (
            told.startswith("ship_trl: FE2 seed 0: the network before training is left out: ")
            and said in told
        )


def test_the_network_before_training_is_the_one_that_training_began_with(
    trained: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(trained)
    (first,) = load_subjects(choose_entries(["runs/1/scratch/seed=0"], False))
    assert first.before is not None and first.source is None and first.copied == ()
    drawn = untrained(first.network, Generator().manual_seed(0))
    assert len(
        {float(one.get_parameter("conv1.weight").detach().sum()) for one in (first.before, *drawn)}
    ) == 1 + len(drawn)


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    with pytest.raises(SystemExit) as left:
        main(list(words))
    assert left.value.code == 1
    told = capsys.readouterr().err
    assert len(told.splitlines()) == 1 and told.startswith("ship_trl: ")
    return told


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("random target=2", "policy: random has no network; allowed: a result folder or a safetensors file"),
        ("FE2", "target: none given for FE2"),
        ("nobody target=2", "policy: no nobody; allowed: random"),
        ("none.safetensors target=2", "policy: no file none.safetensors"),
        ("RUN target=2 --episodes 10", "--episodes: must be from 60 to 600, got 10"),
        ("RUN target=2 --seed -1", "--seed: must be at least 0, got -1"),
        ("RUN RUN target=2", "is given twice"),
        (
            "RUN SOURCE",
            "is of case 2 and 1 scratch seed 0, best of case 1; allowed: one, given as target=CASE",
        ),
        ("RUN target=1,2", "allowed: one, given as target=CASE"),
        ("RUN FIVE target=2", "is of another network than"),
        ("RUN WORLD target=2", "are of different worlds or colours"),
        ("RUN target=2 --output TAKEN", "TAKEN: File exists"),
    ],
)
def test_what_is_wrong_is_said(
    words: str,
    said: str,
    trained: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(trained)
    run = trained / "runs" / "high" / "FE2" / "seed=0"
    places = {"RUN": str(run), "SOURCE": str(trained / "runs" / "1" / "scratch" / "seed=0")}
    if "FIVE" in words:
        places["FIVE"] = five(tmp_path / "five.safetensors")
    if "WORLD" in words:
        places["WORLD"] = str(tmp_path / "world")
        shutil.copytree(run, places["WORLD"])
        config = tmp_path / "world" / "config.yaml"
        config.write_text(config.read_text().replace("max_steps: 60", "max_steps: 61"))
    taken = trained / "TAKEN"
    taken.write_text("mine")
    assert said in refused(capsys, *(places.get(word, word) for word in words.split()))
    assert taken.read_text() == "mine"


def test_a_page_of_no_name_is_written_through_no_link(
    trained: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "outputs").mkdir()
    (tmp_path / "private").mkdir()
    (tmp_path / "outputs/explain").symlink_to(tmp_path / "private")
    said = refused(capsys, str(trained / "runs/high/FE2/seed=0"), "target=2")
    assert "--output: outputs/explain is a link" in said and not list((tmp_path / "private").iterdir())


@pytest.mark.parametrize(
    "line",
    [
        "record RUN --trajectories chart.png",
        "record RUN --output film.gif",
        "export RUN network.onnx",
        "explain RUN",
    ],
)
def test_a_result_without_its_best_network_is_named(line: str, trained: Path, tmp_path: Path) -> None:
    run = tmp_path / "seed=0"
    shutil.copytree(trained / "runs/1/scratch/seed=0", run)
    (run / "policy.safetensors").unlink()
    verb, *words = line.replace("RUN", "seed=0").split()
    done = ship_trl(*words, verb=verb, folder=tmp_path, code=1)
    assert done.stderr.splitlines() == [
        "ship_trl: seed=0/policy.safetensors is not there; left out",
        "ship_trl: policy: seed=0/policy_last.safetensors has no best network beside it",
    ]
    assert [path.name for path in tmp_path.iterdir()] == ["seed=0"]


def five(path: Path) -> str:
    """Save an untrained network of other layers."""
    save_weights(path, DuelingNetwork(1, 7, Generator().manual_seed(0), load_network("five")), {})
    return str(path)


def test_help_knows_no_torch() -> None:
    line = [sys.executable, "-X", "importtime", "-m", "ship_trl", "explain", "--help"]
    done = subprocess.run(line, capture_output=True, text=True, cwd=ROOT, check=True)
    assert "target=CASE" in done.stdout and " torch\n" not in done.stderr
