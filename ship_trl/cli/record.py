"""`python -m ship_trl record POLICY... target=CASE|SUITE --output FILE`: `watch` without a screen.

POLICY is the same as for `watch`; of a result folder, the best network is taken. FILE ends with .gif or
.mp4; any other name is a folder for PNG frames. Several policies, and the cases of a suite, are shown one
after the other, or two policies side by side with --compare. --trajectories draws all of them in one chart.
--situation and --ais write one episode for other tools.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

from pydantic import Field

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_number, add_output, add_policies, add_size, make_parser
from ship_trl.cli.watch import DEFAULT_WORDS
from ship_trl.config.errors import ConfigError, missing_extra
from ship_trl.foreign.suites import MAX_NAMES
from ship_trl.policies.registry import Entry, split_suites
from ship_trl.run.entries import drop_last_networks, find_entries

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pygame import Surface

    from ship_trl.learn.rollout import Episode

FrameRate = Annotated[float, Field(ge=1, le=60)]
Speed = Annotated[float, Field(ge=0.1, le=100)]
ONE = "target=CASE, or situations.scene=NAME of a file of many"


def main(arguments: list[str] | None = None) -> None:
    """Read the arguments, roll out the policies, draw."""
    parser = make_parser("record", __doc__)
    add_policies(parser, DEFAULT_WORDS, "of the first random encounter, and of policies that draw")
    add_output(parser, "--output", (".gif", ".mp4", ""), "film: .gif, .mp4, or a folder of PNG")
    add_output(parser, "--trajectories", (".png",), "chart of all paths")
    add_output(
        parser, "--situation", (".json",), "the episode as a traffic situation (maritime schema 0.2.0)"
    )
    add_output(parser, "--ais", (".csv",), "the episode as AIS positions (MarineCadastre's header of 2025)")
    parser.add_argument("--compare", action="store_true", help="two policies side by side")
    parser.add_argument(
        "--maps", action="store_true", help="the maps of all episodes at once, in large letters"
    )
    parser.add_argument("--saliency", action="store_true", help="the pixels on which the highest Q depends")
    add_size(parser, "1280x720", "of the film; default: 1280x720")
    add_number(parser, "--fps", FrameRate, None, "frames a second; default: 10, of an MP4 30")
    add_number(parser, "--speed", Speed, 5.0, "times as fast as real time; default: 5")
    options = parser.parse_intermixed_args(arguments)
    with refusals():
        is_mp4 = options.output is not None and options.output.suffix == ".mp4"
        exports = [path for path in (options.situation, options.ais) if path is not None]
        if options.output is None and options.trajectories is None and not exports:
            others = "--trajectories, --situation, --ais"
            raise ConfigError(f"--output: none given (.gif, .mp4 or a folder), nor {others}")
        if is_mp4:
            check_mp4(options.size)
        named = drop_last_networks(find_entries(options.words, options.colour))
        entries = split_suites(named, options.seed)
        cases = {entry.suite.case.fingerprint: entry.suite.case.name for entry in entries}
        if options.trajectories is not None and len(cases) > 1:
            names = ", ".join(list(cases.values())[:MAX_NAMES]) + ", ..." * (len(cases) > MAX_NAMES)
            raise ConfigError(f"--trajectories: one case, got {names}; give {ONE}")
        if exports and len(entries) > 1:
            raise ConfigError(
                f"--situation, --ais: one episode, got {len(entries)}; give one policy and {ONE}"
            )

        from ship_trl.run.process import configure_process

        configure_process()
        if options.output is not None:
            options.fps = options.fps or (30.0 if is_mp4 else 10.0)
            record_film(entries, options)
        if options.trajectories is not None:
            record_chart(entries, options)
        if exports:
            write_episode(entries[0], options)


def check_mp4(size: tuple[int, int]) -> None:
    """Check that an MP4 can be encoded, without importing torch or pygame.

    Raises:
        ConfigError: imageio-ffmpeg is not installed or finds no ffmpeg, or a side is odd.
    """
    try:
        import imageio_ffmpeg

        imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        missing = missing_extra("imageio-ffmpeg", "film")
        raise ConfigError(f"--output: an MP4 needs imageio-ffmpeg, a .gif does not; {missing}") from None
    if size[0] % 2 or size[1] % 2:
        raise ConfigError(f"--size: an MP4 needs even numbers, got {size[0]}x{size[1]}")


def record_film(entries: list[Entry], options: Namespace) -> None:
    """Write the film of one entry after the other, or of the first two side by side."""
    from ship_trl.run.console import show_share
    from ship_trl.view.dashboard import Look
    from ship_trl.view.episode import view_entry
    from ship_trl.view.film import draw_film, write_film
    from ship_trl.view.window import distinct_policies

    acts = [entries] if options.maps else [[entry] for entry in entries]
    if options.compare:
        first, second = distinct_policies(entries, True)[:2]
        acts = [[first, replace(second, suite=first.suite)]]
    look = Look(saliency=options.saliency, maps=options.maps)

    def frames() -> Iterator[Surface]:
        with show_share("episodes") as show:
            for done, act in enumerate(acts):
                show(done / len(acts))
                views = [view_entry(entry, options.seed) for entry in act]
                if options.saliency and any(view.sees_numbers for view in views):
                    raise ConfigError("--saliency: allowed for networks that see pixels")
                yield from draw_film(views, look, options.size, options.fps, options.speed)

    write_film(options.output, frames(), options.fps)
    sys.stdout.write(f"{options.output}\n")


def record_chart(entries: list[Entry], options: Namespace) -> None:
    """Draw the paths of all entries on their one case; the seeds of an arm are one group."""
    from ship_trl.policies.named import rollout_entry
    from ship_trl.view.charts import draw_trajectories

    groups: dict[str, list[Episode]] = {}
    for entry in entries:
        _, _, episodes = rollout_entry(entry, seed=options.seed)
        groups.setdefault(entry.label.split(" seed ")[0], []).append(episodes[0])
    draw_trajectories(options.trajectories, entries[0].suite.case, entries[0].world, groups)
    sys.stdout.write(f"{options.trajectories}\n")


def write_episode(entry: Entry, options: Namespace) -> None:
    """Write the first episode of an entry in the forms of other tools, at the scale of the sea."""
    from ship_trl.files.disk import atomic_write
    from ship_trl.foreign.episodes import situation_of
    from ship_trl.formats.ais import write_ais
    from ship_trl.formats.maritime_schema import write_situation
    from ship_trl.policies.named import rollout_entry
    from ship_trl.sim.state import first_case

    _, _, (episode, *_) = rollout_entry(entry, 1, options.seed)
    case = first_case(entry.suite, episode.states[0])
    situation = situation_of(case, episode.states, entry.world)
    for path, write in ((options.situation, write_situation), (options.ais, write_ais)):
        if path is not None:
            with atomic_write(path) as draft:
                draft.write_text(write(situation))
            sys.stdout.write(f"{path}\n")
