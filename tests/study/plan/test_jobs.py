"""Which runs a study has."""

from collections import Counter
from pathlib import Path

import pytest

from ship_trl.run.plan import make_run
from ship_trl.study.launch import write_jobs
from ship_trl.study.plan import Job, plan_jobs, rivals, scratch_place, to_study
from tests.config.test_config import composed


def jobs(*overrides: str) -> list[Job]:
    return plan_jobs(to_study(list(overrides)))


def test_the_quick_study_has_every_arm_pair_and_control() -> None:
    planned = jobs("profile=quick")
    arms = {"scratch", "FTW", *(f"{kind}{n}" for kind in ("FE", "FT") for n in range(1, 5))}
    for pair in ("high", "low", "lowest"):
        found = {(j.arm, j.seed) for j in planned if j.part == "pairs" and j.label == pair}
        assert found == {(arm, seed) for arm in arms for seed in range(5)}
        frozen = Counter(j.arm for j in planned if j.part == "controls" and j.label == pair)
        assert frozen == {f"FE{n}-{kind}": 5 for n in range(1, 5) for kind in ("random", "permuted")}
    for pair in ("self", "self4", "self6"):
        itself = Counter(j.arm for j in planned if j.label == pair)
        assert itself == dict.fromkeys(arms - {"scratch"}, 5)
    assert Counter(j.arm for j in planned if (j.part, j.label) == ("controls", "ship")) == {
        "FE3": 5,
        "FTW": 5,
    }
    places = [j.folder(Path()) for j in planned]
    assert len(set(places)) == len(places) == len({j.name for j in planned})
    assert [j.stage for j in planned] == sorted(j.stage for j in planned)


def test_reuse_is_two_networks_by_two_epsilons_and_other_sources() -> None:
    found = {(j.part, j.label): j for j in jobs() if j.part.startswith("reuse") and j.seed == 0}
    low = {"new", *(f"{case}-new" for case in range(1, 7))}
    assert found.keys() == {("reuse/epsilon_low", label) for label in low} | {
        ("reuse/epsilon_1", "new"),
        ("reuse/epsilon_1", "2-new"),
        ("reuse/alone", "2-new"),
    }
    for (part, label), job in found.items():
        epsilon = job.values.get("learn", {}).get("epsilon_start")
        assert epsilon == (None if part.endswith("1") else 0.1)
        assert (label == "new") == ("source_file" not in job.values)
    reused = found["reuse/epsilon_low", "2-new"]
    assert reused.values["source_file"].endswith("pairs/high/FTW/seed=0/policy.safetensors")
    alone = found["reuse/alone", "2-new"]
    assert alone.values["source_file"].endswith("pairs/high/scratch/seed=0/policy.safetensors")
    other = found["reuse/epsilon_low", "3-new"]
    assert other.values["source_file"].endswith("sources/3/scratch/seed=0/policy.safetensors")
    for case, pair in (("4", "low"), ("6", "lowest")):
        source = found["reuse/epsilon_low", f"{case}-new"].values["source_file"]
        assert source.endswith(f"pairs/{pair}/scratch/seed=0/policy.safetensors")


def test_a_job_started_alone_is_the_studys_run(tmp_path: Path) -> None:
    line = ("profile=smoke", "reuse=false", "controls=false", "pairs=[high]", f"output={tmp_path}")
    config = to_study([*line, "overrides=[learn.lr=0.005,world.max_steps=50]"])
    write_jobs(plan_jobs(config), config)
    place = f"hydra.searchpath=[file://{tmp_path / 'jobs'}]"
    alone = make_run(composed("+job=pairs-high-FE3-0", place))
    as_sent = make_run(composed("+job=pairs-high-FE3-0", "profile=smoke", *config.overrides, place))
    assert alone.config == as_sent.config and alone.config_hash == as_sent.config_hash
    assert alone.config.learn.lr == 0.005 and alone.config.profile == "smoke"


def test_some_controls_are_of_the_first_block_only() -> None:
    planned = [j for j in jobs("seeds=4", "block=2") if j.part == "controls"]
    first = {(j.label, j.arm) for j in planned if j.seed < 2}
    later = {(j.label, j.arm) for j in planned if j.seed >= 2}
    always = {(pair, f"FE3-{kind}") for pair in ("high", "low", "lowest") for kind in ("random", "permuted")}
    always |= {("self", f"{kind}{n}") for kind in ("FE", "FT") for n in range(1, 5)}
    assert later == always | {("ship", "FE3"), ("ship", "FTW")}
    assert later < first and len(first - later) == 6 * 3 + 1 + 2 * 9
    assert {(label, arm) for label, arm in first - later if label == "self"} == {("self", "FTW")}


def test_each_control_is_compared_with_runs_from_scratch_on_its_target() -> None:
    planned = jobs()
    targets = {(j.part, j.label, j.arm): j.values["target"] for j in planned}
    for job in planned:
        if job.part == "controls":
            assert targets[scratch_place(job.part, job.label)] == job.values["target"]


def test_files_that_a_run_needs_come_from_an_earlier_stage() -> None:
    config = to_study([])
    made = {job.folder(config.folder.absolute()): job.stage for job in plan_jobs(config)}
    for job in plan_jobs(config):
        if "source_file" in job.values:
            assert made[Path(job.values["source_file"]).parent] < job.stage


@pytest.mark.parametrize(
    "overrides",
    [
        pytest.param((), marks=pytest.mark.long),
        pytest.param(("pairs=[low]", "reuse=false"), marks=pytest.mark.long),
        ("pairs=[self]", "arms=[scratch,FTW]", "controls=false", "reuse=false"),
    ],
)
def test_nothing_is_trained_twice(overrides: tuple[str, ...]) -> None:
    config = to_study([*overrides, "seeds=2", "profile=smoke"])
    planned = [job for job in plan_jobs(config) if job.seed == 0]
    for job in planned:
        if "source_file" in job.values:
            Path(job.values["source_file"]).parent.mkdir(parents=True, exist_ok=True)
            Path(job.values["source_file"]).write_text(job.values["source_file"])
    write_jobs(planned, config)
    hashes: dict[str, Job] = {}
    for job in planned:
        place = f"hydra.searchpath=[file://{(config.folder / 'jobs').absolute()}]"
        run = make_run(composed(f"+job={job.name}", "profile=smoke", place))
        assert run.config_hash not in hashes, (job, hashes[run.config_hash])
        hashes[run.config_hash] = job
        assert run.folder == job.folder(config.folder.absolute())
        # What it copies from is one of the study's runs, of an earlier stage.
        if run.source is not None:
            assert hashes[run.source.config_hash].stage < job.stage


def test_rivals_are_neither_the_papers_arms_nor_controls_nor_reused_networks() -> None:
    names = ["scratch", "FE1-random", "SP3", "reused, low", "FT2", "FTW", "GUW", "FTH", "G", "SP3-permuted"]
    assert rivals(names) == ["FTH", "GUW", "SP3", "G"]
