"""Which runs a study has."""

from collections import Counter
from pathlib import Path

import pytest

from ship_trl.plan import make_run
from ship_trl.study.config import to_study
from ship_trl.study.launch import write_jobs
from ship_trl.study.plan import Job, plan_jobs
from tests.test_config import composed


def jobs(*overrides: str) -> list[Job]:
    return plan_jobs(to_study(list(overrides)))


def test_the_quick_study_has_every_arm_pair_and_control() -> None:
    planned = jobs("profile=quick")
    arms = {"scratch", "FTW", *(f"{kind}{n}" for kind in ("FE", "FT") for n in range(1, 5))}
    for pair in ("high", "low", "lowest"):
        found = {(j.arm, j.seed) for j in planned if j.part == "pairs" and j.label == pair}
        assert found == {(arm, seed) for arm in arms for seed in range(5)}
        assert sum(j.arm == "FE3-random" and j.label == pair for j in planned) == 5
    self_transfer = Counter(j.arm for j in planned if j.label == "self")
    assert self_transfer == dict.fromkeys(arms - {"scratch", "FTW"}, 5)
    places = [j.folder(Path()) for j in planned]
    assert len(set(places)) == len(places) == len({j.name for j in planned})
    assert [j.stage for j in planned] == sorted(j.stage for j in planned)


def test_the_paper_has_fifteen_seeds() -> None:
    assert {j.seed for j in jobs("profile=paper")} == set(range(15))
    assert {j.seed for j in jobs("seeds=3")} == {0, 1, 2}


def test_seeds_begin_where_it_is_said() -> None:
    planned = jobs("seeds=3", "first_seed=100")
    assert {j.seed for j in planned} == {100, 101, 102}
    # Seeds apart, it is the same study.
    shifted = Counter((j.stage, j.part, j.label, j.arm, j.seed - 100) for j in planned)
    assert shifted == Counter((j.stage, j.part, j.label, j.arm, j.seed) for j in jobs("seeds=3"))


def test_reuse_is_two_networks_by_two_epsilons_and_other_sources() -> None:
    found = {(j.part, j.label): j for j in jobs() if j.part.startswith("reuse") and j.seed == 0}
    low = {"new", "2-new", "1-new", "3-new", "5-new"}
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


def test_a_job_started_alone_is_the_studys_run(tmp_path: Path) -> None:
    line = ("profile=smoke", "reuse=false", "controls=false", "pairs=[high]", f"output={tmp_path}")
    config = to_study([*line, "overrides=[learn.lr=0.005,world.max_steps=50]"])
    write_jobs(plan_jobs(config), config)
    place = f"hydra.searchpath=[file://{tmp_path / 'jobs'}]"
    alone = make_run(composed("+job=pairs-high-FE3-0", place))
    as_sent = make_run(composed("+job=pairs-high-FE3-0", "profile=smoke", *config.overrides, place))
    assert alone.config == as_sent.config and alone.recipe == as_sent.recipe
    assert alone.config.learn.lr == 0.005 and alone.config.profile == "smoke"


def test_files_that_a_run_needs_come_from_an_earlier_stage() -> None:
    config = to_study([])
    made = {job.folder(config.folder.absolute()): job.stage for job in plan_jobs(config)}
    for job in plan_jobs(config):
        if "source_file" in job.values:
            assert made[Path(job.values["source_file"]).parent] < job.stage


@pytest.mark.parametrize(
    "overrides",
    [
        (),
        ("pairs=[low]", "reuse=false"),
        ("arms=[FE2]", "reuse=false"),
        ("pairs=[self]", "arms=[scratch,FTW]", "controls=false", "reuse=false"),
    ],
)
def test_nothing_is_trained_twice(
    overrides: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    config = to_study([*overrides, "seeds=2", "profile=smoke"])
    planned = plan_jobs(config)
    for job in planned:
        if "source_file" in job.values:
            Path(job.values["source_file"]).parent.mkdir(parents=True, exist_ok=True)
            Path(job.values["source_file"]).write_text(job.values["source_file"])
    write_jobs(planned, config)
    recipes: dict[str, Job] = {}
    for job in planned:
        place = f"hydra.searchpath=[file://{(config.folder / 'jobs').absolute()}]"
        run = make_run(composed(f"+job={job.name}", "profile=smoke", place))
        assert run.recipe not in recipes, (job, recipes[run.recipe])
        recipes[run.recipe] = job
        assert run.folder == job.folder(config.folder.absolute())
        # What it copies from is one of the study's runs, of an earlier stage.
        if run.source is not None:
            assert recipes[run.source.recipe].stage < job.stage
