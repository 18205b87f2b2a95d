"""What a window would show, as files; and the GIF of an episode."""

from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np
import pygame
import pytest
from PIL import Image, ImageSequence

from ship_trl.config.types import World
from ship_trl.fast.worlds import make_rasteriser
from ship_trl.sim import scene
from ship_trl.sim.cases import load_case
from ship_trl.view.dashboard import SMALL, Look
from ship_trl.view.episode import EpisodeView, measure_episode
from ship_trl.view.film import LAST_SECONDS, draw_film, write_film, write_gif
from ship_trl.view.style import GOAL_MARK
from tests.view.episodes import drawn, run_actions, view

SIZE = (640, 360)


def frames(world: World) -> Iterator[pygame.Surface]:
    """Ten steps a second, five frames."""
    return draw_film([view(load_case("2", world), world, (3,))], Look(), SIZE, 5, 10.0)


def count(world: World) -> int:
    one = view(load_case("2", world), world, (3,))
    return -(-one.telemetry.steps // 2) + int(LAST_SECONDS * 5)


def test_frames_are_what_the_window_shows(world: World, tmp_path: Path) -> None:
    write_film(tmp_path / "frames", frames(world), 5)
    files = sorted(path.name for path in (tmp_path / "frames").iterdir())
    assert files == [f"{k:05d}.png" for k in range(count(world))]
    one = view(load_case("2", world), world, (3,))
    for k in (0, 3):
        with Image.open(tmp_path / "frames" / f"{k:05d}.png") as saved:
            assert (np.asarray(saved) == drawn([one], 2 * k, size=SIZE)).all()


def test_a_recording_that_stops_leaves_no_folder_of_frames(world: World, tmp_path: Path) -> None:
    def stopped() -> Iterator[pygame.Surface]:
        yield from islice(frames(world), 3)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_film(tmp_path / "frames", stopped(), 5)
    assert not (tmp_path / "frames").exists()
    write_film(tmp_path / "frames", frames(world), 5)
    assert [path.name for path in tmp_path.iterdir()] == ["frames"]


def test_the_gif_of_an_episode_has_a_frame_for_each_state(world: World, tmp_path: Path) -> None:
    case = load_case("6", world)
    # Circling to port: every frame turns, and the step limit ends it.
    episode, draw = run_actions(case, world, [0]), make_rasteriser(world, colour=True)
    path = tmp_path / "episode.gif"
    write_gif(path, case, world, episode, draw, "FT3 from case 5, seed 0")
    assert [p.name for p in tmp_path.iterdir()] == ["episode.gif"]
    assert path.stat().st_size < 1_500_000
    one = EpisodeView(case, "FT3 from case 5, seed 0", measure_episode(world, episode), draw)
    with Image.open(path) as film:
        assert film.size == SMALL.size and film.info["loop"] == 0
        times = []
        for step, frame in enumerate(ImageSequence.Iterator(film)):
            times.append(frame.info["duration"])
            if step % 20 == 7:
                apart = np.asarray(frame.convert("RGB")).astype(int) - drawn([one], step, size=SMALL.size)
                assert np.abs(apart).mean() < 1.0
        last = film.convert("RGB")
    assert times == [100] * episode.length + [2000]
    # Flat colours keep their exact values in the shared palette.
    shown = {tuple(colour) for colour in np.unique(np.asarray(last).reshape(-1, 3), axis=0)}
    assert shown >= {scene.DISC, GOAL_MARK, scene.OWN, scene.TARGET}


def test_a_gif_after_a_window_was_closed(
    world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a person's own pygame program, or gymnasium's window, does in the same process."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    case, draw = load_case("2", world), make_rasteriser(world)
    episode = run_actions(case, world, [3])
    for name in ("before.gif", "after.gif", "again.gif"):
        write_gif(tmp_path / name, case, world, episode, draw)
        pygame.init()
        pygame.display.set_mode((64, 64))
        pygame.quit()
        if name == "after.gif":
            # Fonts are initialised again, by another part of the program; the old ones stay invalid.
            pygame.font.init()
    first, *others = (path.read_bytes() for path in sorted(tmp_path.iterdir()))
    assert all(other == first for other in others)


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
    apart = np.abs(read[0].astype(int) - drawn([view(load_case("2", world), world, (3,))], 0, size=SIZE))
    assert apart.mean() < 6
