"""Episodes as GIF, MP4 or PNG frames, drawn as the window shows them; no screen is needed."""

from __future__ import annotations

import io
import math
import shutil
from collections.abc import Iterator, Sequence
from itertools import chain, islice
from pathlib import Path

import numpy as np
import pygame
from PIL import Image

from ship_trl.config.types import World
from ship_trl.files.disk import atomic_write
from ship_trl.learn.rollout import Episode
from ship_trl.sim import scene
from ship_trl.sim.cases import Case
from ship_trl.sim.render import Rasteriser
from ship_trl.view import palette, pen
from ship_trl.view.dashboard import SMALL_SIZE, Look, draw_dashboard
from ship_trl.view.episode_view import EpisodeView
from ship_trl.view.graph import DIMMED
from ship_trl.view.painter import GRID
from ship_trl.view.telemetry import measure_episode

# Seconds for which the last picture of an episode stays, and steps a second in the GIF of an episode.
LAST, STEPS_PER_SECOND = 2.0, 10
# Colours of a GIF, and how many of its first frames choose them: these hold all lines of the graphs.
COLOURS, SAMPLED = 128, 20
SCENE = (
    *(scene.OUTSIDE, scene.DISC, scene.GOAL_CIRCLE, scene.SAFE_CIRCLE),
    *(scene.OWN, scene.LINE, scene.TARGET),
)
# Kept as they are: the scene in colour and in the network's grey with a ramp between, letters, bars, graphs.
GREYS = tuple((round(float(np.dot(colour, scene.LUMINANCE))),) * 3 for colour in SCENE)
RAMP = tuple((level,) * 3 for level in range(8, 256, 8))
LETTERS = (palette.BACKGROUND, palette.TEXT, palette.FAINT, palette.RULE, palette.BAR, palette.CHOSEN)
LINES = (palette.TEXT, *palette.SERIES)
TO_COME = tuple(palette.blend(line, palette.BACKGROUND, 1 - DIMMED) for line in LINES)
EXACT = (*SCENE, GRID, *GREYS, *RAMP, *LETTERS, *palette.OUTCOMES.values(), *LINES, *TO_COME)


def draw_film(
    acts: Sequence[Sequence[EpisodeView]],
    look: Look,
    size: tuple[int, int],
    frames_per_second: float,
    speed: float,
) -> Iterator[pygame.Surface]:
    """Draw the frames of a film; each is a new surface.

    Acts follow each other, each of one episode or two; `speed` is seconds of the world in one of the film.
    """
    for views in acts:
        steps = max(view.telemetry.steps for view in views)
        advance = speed / frames_per_second / views[0].telemetry.world.dt
        moving = math.ceil(steps / advance)
        for frame in range(moving + max(1, round(LAST * frames_per_second))):
            surface = pen.new_surface(*size)
            draw_dashboard(surface, views, min(frame * advance, float(steps)), look)
            yield surface


def write_gif(
    path: Path | str, case: Case, world: World, episode: Episode, rasteriser: Rasteriser, title: str = ""
) -> None:
    """Write an episode as a GIF that runs for ever, one frame for each step.

    The rasteriser draws what the network saw, in grey or colour; `title` stands beside the name of the case.

    Raises:
        OSError: the file cannot be written.
    """
    view = EpisodeView(title, measure_episode(case, world, episode), rasteriser)
    frames = draw_film([[view]], Look(), SMALL_SIZE, STEPS_PER_SECOND, STEPS_PER_SECOND * world.dt)
    write_film(Path(path), frames, STEPS_PER_SECOND)


def write_film(path: Path, frames: Iterator[pygame.Surface], frames_per_second: float) -> None:
    """Write a GIF or an MP4 as the name ends, or PNG frames into a folder of any other name.

    Raises:
        OSError: it cannot be written.
    """
    if path.suffix == ".gif":
        _write_gif(path, frames, frames_per_second)
    elif path.suffix == ".mp4":
        _write_mp4(path, frames, frames_per_second)
    else:
        _write_frames(path, frames)


def _write_gif(path: Path, frames: Iterator[pygame.Surface], frames_per_second: float) -> None:
    """Write a GIF whose frames share one palette, so that what stands still costs no bytes."""
    pictures = (Image.fromarray(pen.to_array(frame)) for frame in frames)
    first = list(islice(pictures, SAMPLED))
    shared = _shared_palette([first[0], first[len(first) // 2], first[-1]])
    indexed = (
        picture.quantize(palette=shared, dither=Image.Dither.NONE) for picture in chain(first, pictures)
    )
    time = round(1000 / frames_per_second)
    with atomic_write(path) as draft:
        # In memory first: on a full disk Pillow's own writing says no more than "encoder error -2".
        film = io.BytesIO()
        next(indexed).save(film, "GIF", save_all=True, append_images=indexed, duration=time, loop=0)
        draft.write_bytes(film.getvalue())


def _shared_palette(pictures: Sequence[Image.Image]) -> Image.Image:
    """Make a palette of `EXACT` and of the shades between them in some pictures."""
    sheet = Image.fromarray(np.concatenate([np.asarray(picture) for picture in pictures]))
    # Median cut gives colours by area and would lose the small bright things to shades of water.
    shades = sheet.quantize(COLOURS - len(EXACT), method=Image.Quantize.MAXCOVERAGE).getpalette() or []
    shared = Image.new("P", (1, 1))
    shared.putpalette([value for colour in EXACT for value in colour] + shades)
    return shared


def _write_mp4(path: Path, frames: Iterator[pygame.Surface], frames_per_second: float) -> None:
    """Write an MP4 for every player (H.264, yuv420p); width and height must be even."""
    import imageio_ffmpeg

    first = next(frames)
    with atomic_write(path) as draft:
        writer = imageio_ffmpeg.write_frames(
            str(draft),
            first.get_size(),
            fps=frames_per_second,
            macro_block_size=2,
            quality=7,
            ffmpeg_log_level="error",
            output_params=["-movflags", "+faststart"],
        )
        writer.send(None)
        for frame in chain([first], frames):
            writer.send(pygame.image.tobytes(frame, "RGB"))
        writer.close()


def _write_frames(folder: Path, frames: Iterator[pygame.Surface]) -> None:
    """Write PNGs from 00000.png on into a folder that is new or empty; all of them or none."""
    draft = folder.with_name(f".{folder.name}.part")
    shutil.rmtree(draft, ignore_errors=True)
    draft.mkdir(parents=True)
    try:
        for number, frame in enumerate(frames):
            pygame.image.save(frame, str(draft / f"{number:05d}.png"))
        draft.replace(folder)
    finally:
        shutil.rmtree(draft, ignore_errors=True)
