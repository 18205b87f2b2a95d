"""The hash of a run's settings, streams and folder."""

import dataclasses
from pathlib import Path

import pytest

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import Reward, World, world_values
from ship_trl.run.plan import Run, find_result, make_run
from tests.a_result import a_result
from tests.config.test_config import composed


def run(*overrides: str) -> Run:
    return make_run(composed(*overrides))


def test_source_is_the_scratch_run_of_the_source_case() -> None:
    transfer, scratch = run("+pair=high", "layers=3"), run("target=1", "method=scratch")
    assert transfer.source is not None
    assert transfer.source.config_hash == scratch.config_hash
    assert transfer.source.folder == scratch.folder
    assert all(transfer.source.stream(name) == scratch.stream(name) for name in ("weights", "replay"))


def test_a_source_file_is_known_by_its_content(tmp_path: Path) -> None:
    path, hashes = tmp_path / "policy.safetensors", set()
    for content in (b"one", b"another"):
        path.write_bytes(content)
        for weights in ("learned", "permuted"):
            line = ("+pair=high", "+arm=FE3", f"source_file={path}", f"source_weights={weights}")
            hashes.add(run(*line).config_hash)
    assert len(hashes) == 4


@pytest.mark.parametrize(
    "change",
    [
        "seed=1",
        "method=feature_extraction",
        "colour=true",
        "network.vector_time=8",
        "observation=vector",
        "mask=rules",
        "algorithm=n_step",
        "learn.lr=0.5",
        "learn.episodes=7",
        "source=3",
        "source_weights=random",
        "source_weights=permuted",
    ],
)
def test_config_hash_tells_runs_apart(change: str) -> None:
    lines = ["+pair=high", "layers=3"]
    assert run(*lines).config_hash != run(*lines, change).config_hash


@pytest.mark.parametrize(
    "change",
    [
        "output=elsewhere",
        "logger=wandb",
        "objective=best",
        "overwrite=true",
        "learn.jumpstart_draws=0",
        "learn.backend=dense",
        "fast=false",
    ],
)
def test_config_hash_ignores_what_is_not_learned_from(change: str) -> None:
    lines = ["+pair=high", "layers=3"]
    assert run(*lines).config_hash == run(*lines, change).config_hash


@dataclasses.dataclass
class LongerReward(Reward):
    """A reward with a term of one's own, zero in the paper's world."""

    rudder: float = 0.0


def test_a_later_term_of_the_reward_changes_no_older_digest(world: World) -> None:
    longer = LongerReward(**dataclasses.asdict(world.reward))
    assert world_values(dataclasses.replace(world, reward=longer)) == world_values(world)
    paid = dataclasses.replace(world, reward=dataclasses.replace(longer, rudder=-10.0))
    assert world_values(paid)["reward"]["rudder"] == -10.0


def test_no_two_streams_are_the_same() -> None:
    lines = ("target=1 method=scratch", "+pair=high layers=1", "source=2 target=2 layers=1")
    runs = [
        make_run(dataclasses.replace(config, seed=seed))
        for config in (composed(*line.split()) for line in lines)
        for seed in range(5)
    ]
    seeds = [r.stream(purpose) for r in runs for purpose in ("weights", "exploration", "replay")]
    assert len(set(seeds)) == len(seeds) == 45
    assert all(0 <= seed < 2**63 for seed in seeds)


def test_finished_run_of_other_settings_is_not_lost(tmp_path: Path) -> None:
    first = run("target=1", "method=scratch", f"output={tmp_path}")
    first.folder.mkdir(parents=True)
    made = a_result(config_hash=first.config_hash)
    made.write(first.folder)
    assert find_result(run("target=1", "method=scratch", f"output={tmp_path}")) == made
    with pytest.raises(ConfigError, match=r"holds a finished run of other settings.*overwrite=true"):
        run("target=1", "method=scratch", f"output={tmp_path}", "learn.lr=0.5")
    run("target=1", "method=scratch", f"output={tmp_path}", "learn.lr=0.5", "overwrite=true")


def test_overwrite_is_for_the_target_and_not_for_its_source(tmp_path: Path) -> None:
    source = run("target=1", "method=scratch", f"output={tmp_path}")
    source.folder.mkdir(parents=True)
    a_result(config_hash=source.config_hash).write(source.folder)
    line = ("+pair=high", "layers=1", f"output={tmp_path}", "overwrite=true")
    assert run(*line).source is not None
    with pytest.raises(ConfigError, match=r"where the source would be trained.*target=1 method=scratch"):
        run(*line, "learn.lr=0.5")


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("{}", "has schema_version None; only 3 can be read"),
        ('{"pair": "hi', "cannot be read"),
    ],
)
def test_a_damaged_result_is_called_damaged_and_is_not_lost(tmp_path: Path, text: str, reason: str) -> None:
    line = ("target=1", "method=scratch", f"output={tmp_path}")
    first = run(*line)
    first.folder.mkdir(parents=True)
    damaged = first.folder / "result.json"
    damaged.write_text(text)
    said = rf"holds a damaged result: result.json {reason}; allowed: .* overwrite=true"
    with pytest.raises(ConfigError, match=said):
        run(*line)
    with pytest.raises(ConfigError, match=r"source would be trained, holds a damaged result: result\.json"):
        run("+pair=high", "layers=1", f"output={tmp_path}")
    assert damaged.read_text() == text
    assert find_result(run(*line, "overwrite=true")) is None


def test_pretrained_is_the_network_of_the_pair_or_of_the_most_similar_case() -> None:
    given = run("+pair=low", "layers=3", "source=pretrained")
    assert given.pretrained is not None and given.pretrained.name == "3" and given.source is None
    assert given.folder.parts[-3:] == ("low", "FT3-pretrained", "seed=0")
    same = run("+pair=low", "layers=3", "source_weights=pretrained")
    assert (same.config_hash, same.folder) == (given.config_hash, given.folder)
    assert given.config_hash != run("+pair=low", "layers=3").config_hash
    nearest = run("target=4", "layers=3", "source=pretrained")
    assert nearest.pretrained == given.pretrained and nearest.folder.parts[-3] == "3-4"
    # A run from scratch in the same grid is in the same folder, and does not depend on the source.
    alone = run("target=4", "method=scratch", "source=pretrained")
    assert alone.folder.parts[-3] == "3-4" and alone.pretrained is None
    assert alone.config_hash == run("target=4", "method=scratch").config_hash


def test_a_suite_is_named_where_a_case_is() -> None:
    line = ("method=finetune", "layers=2")
    to_one, to_suite = run("source=paper", "target=4", *line), run("source=4", "target=paper", *line)
    assert to_one.title == "suite paper -> case 4, FT2, seed 0"
    assert to_suite.folder.parts[-3:] == ("4-paper", "FT2", "seed=0")
    assert [len(one.target.cases) for one in (to_one, to_suite)] == [1, 7]
    alone = run("target=paper", "method=scratch")
    assert to_one.source is not None and to_one.source.config_hash == alone.config_hash
    assert (alone.evaluation_episodes, to_one.evaluation_episodes) == (7, 1)
    # Each case is evaluated equally often.
    perturbed = ("target=paper", "method=scratch", "perturbation.own_position=5")
    assert run(*perturbed, "learn.evaluate_episodes=8").evaluation_episodes == 14


def test_a_perturbation_is_of_source_and_target_and_in_the_hash_only_when_set() -> None:
    line = ("source=1", "target=4", "layers=1")
    plain, drawn = run(*line), run(*line, "perturbation.own_position=50")
    assert run(*line, "perturbation.own_position=0").config_hash == plain.config_hash != drawn.config_hash
    assert plain.source is not None and drawn.source is not None
    assert plain.source.config_hash != drawn.source.config_hash
    assert plain.stream("weights") != drawn.stream("weights")
    few = "learn.evaluate_episodes=9"
    assert run(*line, few).config_hash == plain.config_hash
    fewer = run(*line, "perturbation.own_position=50", few)
    assert fewer.config_hash != drawn.config_hash and fewer.evaluation_episodes == 9


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("source=pretrained target=paper layers=1", "suite paper: has several cases; allowed here: one case"),
        ("target=paper method=scratch demonstrations=here", "demonstrations: allowed with one case as tar"),
        ("target=1 method=scratch demonstrations=here perturbation.own_heading=1", "demonstrations: allowed"),
        ("target=papers method=scratch", "target: no case or suite papers; allowed: 1, 2"),
    ],
)
def test_what_needs_a_single_case_is_refused(line: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        run(*line.split())
