"""What a window would show, as files."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pygame
import pytest
from PIL import Image

from ship_trl.config.types import World
from ship_trl.sim.cases import load_case
from ship_trl.viewer.dashboard import Look
from ship_trl.viewer.film import LAST, draw_film, write_film
from tests.viewer.shown import drawn, show

SIZE = (640, 360)


def frames(world: World) -> Iterator[pygame.Surface]:
    """Ten steps a second, five frames."""
    one = show(load_case("2", world), world, (3,))
    return draw_film([[one]], Look(), SIZE, 5, 10.0)


def count(world: World) -> int:
    one = show(load_case("2", world), world, (3,))
    return -(-one.telemetry.steps // 2) + int(LAST * 5)


def test_frames_are_what_the_window_shows(world: World, tmp_path: Path) -> None:
    write_film(tmp_path / "frames", frames(world), 5)
    files = sorted(path.name for path in (tmp_path / "frames").iterdir())
    assert files == [f"{k:05d}.png" for k in range(count(world))]
    one = show(load_case("2", world), world, (3,))
    for k in (0, 3):
        with Image.open(tmp_path / "frames" / f"{k:05d}.png") as saved:
            assert (np.asarray(saved) == drawn([one], 2 * k, size=SIZE)).all()


def test_a_gif(world: World, tmp_path: Path) -> None:
    write_film(tmp_path / "film.gif", frames(world), 5)
    with Image.open(tmp_path / "film.gif") as film:
        # Frames that stay the same are one of a longer time.
        times = []
        for k in range(getattr(film, "n_frames", 0)):
            film.seek(k)
            times.append(film.info["duration"])
        assert sum(times) == 200 * count(world) and film.size == SIZE
        assert film.info["loop"] == 0
    assert [path.name for path in tmp_path.iterdir()] == ["film.gif"]


# imageio-ffmpeg leaves it to the garbage collector to close its pipes.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning", "ignore::ResourceWarning")
def test_an_mp4(world: World, tmp_path: Path) -> None:
    ffmpeg = pytest.importorskip("imageio_ffmpeg")
    path = tmp_path / "film.mp4"
    write_film(path, frames(world), 5)
    reader = ffmpeg.read_frames(str(path))
    about = next(reader)
    read = [np.frombuffer(frame, np.uint8).reshape(SIZE[1], SIZE[0], 3) for frame in reader]
    assert about["size"] == SIZE and len(read) == count(world)
    one = show(load_case("2", world), world, (3,))
    apart = np.abs(read[0].astype(int) - drawn([one], 0, size=SIZE))
    assert apart.mean() < 6
