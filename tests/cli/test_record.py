"""`python -m ship_trl record`: films and charts without a screen."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from torch import Generator

from ship_trl.cli.record import main
from ship_trl.config.network import load_network
from ship_trl.learn.network import make_network
from ship_trl.transfer.weights import save_weights
from tests.command import environment, refused


def picture(path: str | Path) -> NDArray[np.uint8]:
    with Image.open(path) as opened:
        return np.asarray(opened).copy()


def test_a_film_and_a_chart(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = "keep_course random --compare target=4 --output film.gif --trajectories paths.png --fps 5"
    main(line.split())
    assert capsys.readouterr().out.splitlines() == ["film.gif", "paths.png"]
    with Image.open("film.gif") as film:
        assert film.size == (1280, 720) and getattr(film, "n_frames", 0) > 10
    assert picture("paths.png").shape[1] > 500
    assert sorted(path.name for path in tmp_path.iterdir()) == ["film.gif", "paths.png"]


def test_folders_are_made(tmp_path: Path) -> None:
    line = "keep_course target=4 --output new/frames --trajectories other/paths.png --fps 1 --speed 20"
    main(line.split())
    assert {path.suffix for path in (tmp_path / "new/frames").iterdir()} == {".png"}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["new", "other"]


def test_maps_of_several_cases_are_one_film(capsys: pytest.CaptureFixture[str]) -> None:
    line = "keep_course target=1,2 --maps --size 640x400 --fps 2 --speed 20 --output film.gif"
    main(line.split())
    assert capsys.readouterr().out == "film.gif\n"
    with Image.open("film.gif") as film:
        # Equal frames are one; after 36 s nothing moves.
        assert film.size == (640, 400) and getattr(film, "n_frames", 0) == 5


def test_a_network_of_numbers_has_a_film_without_saliency(capsys: pytest.CaptureFixture[str]) -> None:
    network = make_network(load_network("vector"), 7, Generator().manual_seed(0))
    save_weights(Path("vector.safetensors"), network, {})
    line = ["vector.safetensors", "target=2", "--output", "film.gif", "--fps", "1", "--speed", "30"]
    assert "--saliency: allowed for networks that see pixels" in refused(capsys, main, *line, "--saliency")
    assert not Path("film.gif").exists()
    main(line)
    assert Path("film.gif").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("random target=2", "--output: none given"),
        (
            "random target=2 --output film.avi",
            "--output: must be a name that ends with .gif or .mp4, or a new",
        ),
        (
            "random target=2 --output there",
            "or a new or empty folder, got there",
        ),
        ("random target=2 --trajectories chart.pdf", "--trajectories: must be a name that ends with .png"),
        ("random target=1,2 --trajectories chart.png", "--trajectories: one case, got 1, 2"),
        ("random target=2 --output film.gif --compare", "--compare: needs two policies"),
    ],
)
def test_wrong_input_is_refused(words: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    Path("there").mkdir()
    Path("there/kept").touch()
    assert said in refused(capsys, main, *words.split())
    assert [path.name for path in Path().iterdir()] == ["there"]


def test_an_mp4_without_ffmpeg_is_refused_before_torch_is_imported() -> None:
    words = ["random", "target=2", "--output", "film.mp4"]
    program = (
        "import atexit, sys; sys.modules['imageio_ffmpeg'] = None\n"
        "atexit.register(lambda: print({'torch', 'pygame'} & set(sys.modules)))\n"
        f"from ship_trl.cli.record import main; main({words})"
    )
    line = [sys.executable, "-c", program]
    done = subprocess.run(line, capture_output=True, text=True, env=environment(), check=False)
    assert done.returncode == 1 and done.stdout == "set()\n"
    assert done.stderr.startswith("ship_trl: --output: an MP4 needs imageio-ffmpeg")
