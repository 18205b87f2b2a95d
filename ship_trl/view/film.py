"""Write episodes as GIF, MP4 or PNG frames, drawn as the window shows them; no screen is needed."""

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
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.rollout import Episode
from ship_trl.sim import scene
from ship_trl.sim.cases import Case
from ship_trl.sim.render import Rasteriser
from ship_trl.view import pen
from ship_trl.view.dashboard import SMALL, Look, draw_dashboard
from ship_trl.view.episode import EpisodeView, measure_episode
from ship_trl.view.maps import draw_maps
from ship_trl.view.style import GOAL_MARK, OUTCOMES

# Seconds for which the last picture of an episode stays.
LAST_SECONDS = 2.0
STEPS_PER_SECOND = 10
# Colours of a GIF. They are chosen from its first frames, and from exact ones that must not be averaged.
COLOURS, SAMPLED_FRAMES = 128, 20
# Pillow looks up the nearest colour of a palette for cubes of this side: for their darkest corner.
PILLOW_CUBE = 4
SCENE = (scene.OUTSIDE, scene.DISC, scene.GOAL_CIRCLE, scene.SAFE_CIRCLE, scene.OWN, scene.LINE, scene.TARGET)
EXACT = (*SCENE, GOAL_MARK, *OUTCOMES.values())


def draw_film(
    views: Sequence[EpisodeView], look: Look, size: tuple[int, int], frames_per_second: float, speed: float
) -> Iterator[pygame.Surface]:
    """Draw the frames of one episode, or of two side by side, or many maps; each is a new surface.

    `speed` is simulated seconds per second of the film.
    """
    steps = max(view.telemetry.steps for view in views)
    advance = speed / frames_per_second / views[0].telemetry.world.dt
    for frame in range(math.ceil(steps / advance) + max(1, round(LAST_SECONDS * frames_per_second))):
        surface, position = pen.new_surface(*size), min(frame * advance, float(steps))
        if look.maps:
            draw_maps(surface, views, position)
        else:
            draw_dashboard(surface, views, position, look)
        yield surface


def write_gif(
    path: Path | str,
    case: Case,
    world: World,
    episode: Episode,
    rasteriser: Rasteriser,
    title: str = "",
    network: DuelingNetwork | None = None,
) -> None:
    """Write an episode as a looping GIF with one frame for each step.

    The rasteriser draws what the network saw; `title` follows the name of the case.
    """
    view = EpisodeView(case, title, measure_episode(world, episode), rasteriser, network)
    frames = draw_film([view], Look(), SMALL.size, STEPS_PER_SECOND, STEPS_PER_SECOND * world.dt)
    write_film(Path(path), frames, STEPS_PER_SECOND)


def write_film(path: Path, frames: Iterator[pygame.Surface], frames_per_second: float) -> None:
    """Write a .gif or .mp4 file; for any other name write PNG frames into a new or empty folder."""
    if path.suffix == ".gif":
        _write_gif(path, frames, frames_per_second)
    elif path.suffix == ".mp4":
        _write_mp4(path, frames, frames_per_second)
    else:
        draft = path.with_name(f".{path.name}.part")
        shutil.rmtree(draft, ignore_errors=True)
        draft.mkdir(parents=True)
        for number, frame in enumerate(frames):
            pygame.image.save(frame, str(draft / f"{number:05d}.png"))
        draft.replace(path)


def _write_gif(path: Path, frames: Iterator[pygame.Surface], frames_per_second: float) -> None:
    """Write a GIF whose frames share one palette: then pixels that do not change cost no bytes."""

    def index(picture: Image.Image) -> Image.Image:
        indexed = picture.quantize(palette=corners, dither=Image.Dither.NONE)
        indexed.putpalette(colours)
        return indexed

    pictures = (Image.fromarray(pen.to_array(frame)) for frame in frames)
    first = list(islice(pictures, SAMPLED_FRAMES))
    samples = [np.asarray(first[k]) for k in (0, len(first) // 2, -1)]
    # An octree keeps small bright things; median cut would give their colours to shades of water.
    octree = Image.Quantize.FASTOCTREE
    shades = Image.fromarray(np.concatenate(samples)).quantize(COLOURS - len(EXACT), method=octree)
    colours = [*chain(*EXACT), *(shades.getpalette() or [])]
    # An exact colour is found if the palette of the search has the corner of its cube.
    corners = Image.new("P", (1, 1))
    corners.putpalette([number - number % PILLOW_CUBE for number in colours])
    indexed = map(index, chain(first, pictures))
    milliseconds = round(1000 / frames_per_second)
    with atomic_write(path) as draft:
        # Encode in memory: on a full disk Pillow would raise only "encoder error -2".
        film = io.BytesIO()
        next(indexed).save(film, "GIF", save_all=True, append_images=indexed, duration=milliseconds, loop=0)
        draft.write_bytes(film.getvalue())


def _write_mp4(path: Path, frames: Iterator[pygame.Surface], frames_per_second: float) -> None:
    """Write an MP4 that every player reads (H.264, yuv420p); width and height must be even."""
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
