"""`python -m ship_trl explain`: the page, its figures and tables, of networks that were really trained."""

import json
import shutil
from pathlib import Path

import pandas as pd
import pytest
from PIL import Image
from torch import Generator

from ship_trl.cli.explain import choose_entries, main
from ship_trl.config.network import load_network
from ship_trl.explain.networks import Origin, find_origin, make_untrained
from ship_trl.learn.network import DuelingNetwork, make_network
from ship_trl.transfer.weights import save_weights
from tests.command import SMOKE, refused, ship_trl

# The paper's layers with few filters, so that a page takes seconds.
SMALL = "conv: [[8, 8, 4], [8, 4, 2], [8, 3, 1], [20, 7, 1]]\nhidden: 20\n"
RUN, SOURCE = Path("runs/high/FE2/seed=0"), Path("runs/1/scratch/seed=0")
FIGURES = {"probes", "change", "erased", "saliency"}
TABLES = {"probes", "cka", "erased"}


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("explain")
    (folder / "own" / "network").mkdir(parents=True)
    (folder / "own" / "network" / "small.yaml").write_text(SMALL)
    line = ("--config-dir", "own", "network=small", "+pair=high", "method=feature_extraction", "layers=2")
    ship_trl(*line, *SMOKE, "output=runs", folder=folder)
    return folder


@pytest.fixture(scope="module")
def page(trained: Path) -> Path:
    line = (str(RUN), str(SOURCE), "target=2", "--episodes", "60", "--output", "page")
    done = ship_trl(*line, verb="explain", folder=trained)
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
    assert html.count("<td>conv1, conv2</td>") == 1, "copied layers"


def test_frozen_layers_stay_and_the_others_change(page: Path) -> None:
    rows = pd.read_csv(page / "cka.csv")
    mine = rows[(rows.first_role == "explained") & (rows.second_role == "before training")].set_index("layer")
    assert mine.cka[["conv1", "conv2"]].tolist() == pytest.approx([1, 1])
    source = rows[(rows.first_role == "before training") & (rows.second_role == "source")].set_index("layer")
    assert source.cka[["conv1", "conv2"]].tolist() == pytest.approx([1, 1])
    assert source.cka["conv4"] < 0.99 and mine.cka["conv4"] < 1


def test_shuffled_labels_are_not_read(page: Path) -> None:
    rows = pd.read_csv(page / "probes.csv")
    assert rows.shuffled_r2.max() < 0.2 and rows.r2.max() > 0.5
    assert ((rows.r2_low <= rows.r2) & (rows.r2 <= rows.r2_high)).all()


def origin_of(run: Path) -> Origin:
    (entry,) = choose_entries([str(run)], False)
    return find_origin(entry, "mine")


def test_a_missing_source_is_named(
    trained: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    # The source is named relative to where the run was started, which may be another folder.
    monkeypatch.chdir(tmp_path)
    assert origin_of(trained / RUN).source is not None
    monkeypatch.chdir(trained)
    whole = origin_of(RUN)
    assert whole.source is not None and whole.before is not None
    assert whole.copied == ("conv1", "conv2")
    moved = tmp_path / "moved"
    shutil.copytree(RUN, moved)
    result = json.loads((moved / "result.json").read_text())
    for changes, message in (
        ({"source_network": "gone.safetensors"}, "source_file: no file gone.safetensors; allowed: a"),
        ({"before": result["before"] | {"return": 1.0}}, "it should return 1.0 and returns "),
    ):
        (moved / "result.json").write_text(json.dumps(result | changes))
        assert origin_of(moved).before is None
        error = capsys.readouterr().err
        assert error.startswith("ship_trl: mine: the network before training is left out: ")
        assert message in error


def test_the_start_of_a_run_from_scratch_is_drawn_again(
    trained: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(trained)
    first = origin_of(SOURCE)
    assert first.before is not None and first.source is None and first.copied == ()
    generator = Generator().manual_seed(0)
    networks = [first.before, *(make_untrained(first.before, generator) for _ in range(2))]
    sums = {float(one.get_parameter("conv1.weight").detach().sum()) for one in networks}
    assert len(sums) == len(networks)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("random target=2", "policy: random has no network; allowed: a result folder or a safetensors file"),
        ("RUN RUN target=2", "is given twice"),
        ("RUN SOURCE", "best (case 1) differ in case, world or colours; allowed: one target=CASE"),
        ("RUN FIVE target=2", "has other layers than"),
        ("VECTOR target=2", "vector.safetensors sees numbers; allowed: networks that see pixels"),
        ("RUN WORLD target=2", "differ in case, world or colours"),
        ("RUN target=2 --output TAKEN", "TAKEN: File exists"),
    ],
)
def test_wrong_input_is_refused(
    words: str,
    message: str,
    trained: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(trained)
    five, world, taken = tmp_path / "five.safetensors", tmp_path / "world", trained / "TAKEN"
    vector = tmp_path / "vector.safetensors"
    places = {"RUN": str(RUN), "SOURCE": str(SOURCE), "FIVE": str(five), "WORLD": str(world)}
    places["VECTOR"] = str(vector)
    if "FIVE" in words:
        save_weights(five, DuelingNetwork(1, 7, Generator().manual_seed(0), load_network("five")), {})
    if "VECTOR" in words:
        save_weights(vector, make_network(load_network("vector"), 7, Generator().manual_seed(0)), {})
    if "WORLD" in words:
        shutil.copytree(RUN, world)
        config = world / "config.yaml"
        config.write_text(config.read_text().replace("max_steps: 60", "max_steps: 61"))
    taken.write_text("mine")
    assert message in refused(capsys, main, *(places.get(word, word) for word in words.split()))
    assert taken.read_text() == "mine"
