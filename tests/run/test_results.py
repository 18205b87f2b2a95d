"""Finished runs by their settings."""

from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
from omegaconf import OmegaConf

from ship_trl.config.paths import conf_dir
from ship_trl.run.results import collect, group_runs, locate, tell_apart
from tests.a_result import a_result

SETTINGS = st.dictionaries(st.sampled_from("abcd"), st.sampled_from("xyz"))


@given(st.lists(SETTINGS, min_size=1, max_size=8))
def test_words_are_the_same_if_and_only_if_the_settings_are(settings: list[dict[str, str]]) -> None:
    words = tell_apart(settings)
    for one, own in zip(settings, words, strict=True):
        assert [own == other for other in words] == [one == other for other in settings]
        assert all(word.split("=")[1] == one.get(word[0], "-") for word in own.split())


def test_the_most_frequent_value_is_not_named() -> None:
    usual = {"learn.lr": "0.001", "network": "paper"}
    assert tell_apart([usual, usual, usual | {"learn.lr": "0.01"}, usual | {"network": "five"}]) == [
        "", "", "learn.lr=0.01", "network=five",
    ]  # fmt: skip
    # Of two that are as frequent neither is the usual one.
    assert tell_apart([usual, usual | {"learn.lr": "0.01"}]) == ["learn.lr=0.001", "learn.lr=0.01"]
    assert tell_apart([usual, usual]) == ["", ""]


def write(folder: Path, arm: str, seed: int, profile: str = "quick", **settings: Any) -> None:
    """Write a run with a part of a configuration."""
    place = folder / "low" / arm / f"seed={seed}"
    place.mkdir(parents=True)
    a_result(pair="low", arm=arm, seed=seed, profile=profile).write(place)
    told: dict[str, Any] = {"seed": seed, "output": str(folder), "source": "3", "learn": {"lr": 1e-4}}
    OmegaConf.save(OmegaConf.create(told | settings), place / "config.yaml")


def rows(folder: Path) -> dict[str, list[int]]:
    """The seeds of each row."""
    return {name: [one.seed for one in runs] for name, runs in group_runs(collect(folder)).items()}


def test_a_row_holds_runs_that_differ_only_in_their_seeds(tmp_path: Path) -> None:
    for seed in range(3):
        # The source of each seed is its own.
        write(tmp_path, "FT3", seed, source_file=f"a/seed={seed}/policy.safetensors", device=f"cuda:{seed}")
        write(tmp_path, "scratch", seed, source=None)
    assert rows(tmp_path) == {"low FT3": [0, 1, 2], "low scratch": [0, 1, 2]}
    write(tmp_path, "FT3", 3, source_file="a/seed=3/policy.safetensors", learn={"lr": 0.01})
    write(tmp_path, "FT3", 4, source_file="b/policy.safetensors")
    five = OmegaConf.load(conf_dir() / "network/five.yaml")
    write(tmp_path, "FT3", 5, source_file="a/seed=5/policy.safetensors", network=five)
    write(tmp_path, "scratch", 6, "long", source=None)
    assert rows(tmp_path) == {
        "low FT3": [0, 1, 2],
        "low FT3 learn.lr=0.01": [3],
        "low FT3 network=five": [5],
        "low FT3 source_file=b/policy.safetensors": [4],
        "low scratch": [0, 1, 2],
        "low scratch profile=long": [6],
    }


def test_a_file_is_found_from_the_folder_where_the_run_was_started(tmp_path: Path) -> None:
    network, run = tmp_path / "outputs/case_base/policy.safetensors", tmp_path / "outputs/low/FT3/seed=0"
    network.parent.mkdir(parents=True)
    network.touch()
    run.mkdir(parents=True)
    assert locate("outputs/case_base/policy.safetensors", run) == str(network)
    assert locate("outputs/none.safetensors", run) == "outputs/none.safetensors"
    # The name of a case is no file.
    (tmp_path / "4").touch()
    assert locate("4", run) == "4"
    # Of folders only those with files of other tools count.
    situations = tmp_path / "scenes/one.json"
    situations.parent.mkdir()
    situations.touch()
    assert locate("scenes", run) == str(situations.parent)
    assert locate("low", run) == "low"
