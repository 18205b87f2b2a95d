"""The page of many episodes: every path, failures first."""

from pathlib import Path

import numpy as np
from PIL import Image

from ship_trl.config.types import World
from ship_trl.learn.rollout import Episode
from ship_trl.policies.entry import Entry, rollout_entry
from ship_trl.sim.suites import load_suite
from ship_trl.view import pen
from ship_trl.view.episode_page import MAX_PICTURES, WIDTH, draw_paths, write_episode_page
from ship_trl.view.palette import OUTCOMES


def episodes_of(world: World, suite: str, policy: str = "keep_course") -> list[Episode]:
    return rollout_entry(Entry(policy, policy, load_suite(suite, world), world, colour=False))[2]


def count_pixels(picture: np.ndarray, outcome: str) -> int:
    return int((np.abs(picture.astype(int) - OUTCOMES[outcome]).sum(-1) < 9).sum())


def read(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))


def test_a_path_has_the_colour_of_its_end(world: World) -> None:
    _, kept, hit, *_ = episodes_of(world, "paper")
    for episode, other in ((kept, "collision"), (hit, "goal")):
        picture = pen.to_array(draw_paths(episode, world, 140, 800.0))
        assert count_pixels(picture, episode.outcome) > 30 and count_pixels(picture, other) == 0


def test_failures_come_first(world: World, tmp_path: Path) -> None:
    episodes = episodes_of(world, "paper")
    names = [str(k) for k in range(len(episodes))]
    write_episode_page(tmp_path / "page.png", "kept", names, episodes, world)
    page = read(tmp_path / "page.png")
    assert page.shape[1] == WIDTH
    # Four of seven collide: the left half of the page, below its title.
    left, right = page[50:, : WIDTH // 2], page[50:, WIDTH // 2 :]
    assert count_pixels(left, "collision") > 100 and count_pixels(left, "goal") == 0
    assert count_pixels(right, "goal") > 100 and count_pixels(right, "collision") == 0
    assert [path.name for path in tmp_path.iterdir()] == ["page.png"]


def test_a_page_has_a_largest_size(world: World, tmp_path: Path) -> None:
    episodes = 10 * episodes_of(world, "paper")
    assert len(episodes) > MAX_PICTURES
    for name, some in (("all", episodes), ("some", episodes[:MAX_PICTURES])):
        write_episode_page(tmp_path / f"{name}.png", "kept", ["x"] * len(some), some, world)
    assert read(tmp_path / "all.png").shape == read(tmp_path / "some.png").shape
