"""The functions that read files from outside: the file of the library that is damaged, and what reads it."""

import contextlib
import hashlib
import json
from collections.abc import Callable
from pathlib import Path

from torch import Generator

from ship_trl.cli.results import summarise
from ship_trl.config.errors import ConfigError
from ship_trl.explain.networks import read_config
from ship_trl.files.curve import read_curve, split
from ship_trl.files.disk import read_file
from ship_trl.learn.network import DuelingNetwork
from ship_trl.policies.demonstrations import read_demonstrations
from ship_trl.run.checkpoint import Checkpoints
from ship_trl.run.entries import settings_of
from ship_trl.run.results import collect
from ship_trl.sim.cases import load_case, load_world
from ship_trl.sim.reference import best_known
from ship_trl.study.analysis.metrics import METRICS
from ship_trl.study.analysis.study import read_study
from ship_trl.study.plan.config import to_study
from ship_trl.study.plan.jobs import plan_jobs
from ship_trl.study.plan.manifest import read_manifest, read_plan, write_plan
from ship_trl.study.records.layers import read_layers
from ship_trl.study.records.tables import read_tables
from ship_trl.transfer.casebase import CaseBase
from ship_trl.transfer.layers import load_weights, saved_network
from ship_trl.transfer.measured import read_transfers
from tests.faults.library import BASE, RUN, STOPPED, STUDY

MET, WEIGHTS = "conf/case/met.yaml", f"{RUN}/policy.safetensors"


def weights() -> None:
    network = DuelingNetwork(1, 7, Generator(), saved_network(Path(WEIGHTS), "policy"))
    network.load_state_dict(dict(load_weights(Path(WEIGHTS), network, "policy")))


def checkpoints() -> None:
    """Read a stopped run's checkpoints: of two, one is damaged, and the other must be found."""
    found = Checkpoints(Path(STOPPED))
    if found.folder.is_dir():
        about = found.about()
        assert about is not None
        whole, damaged = found.read(about.config_hash)
        assert whole is not None and not any("\n" in reason for reason in damaged.values())


def case_base() -> None:
    base, case = CaseBase(Path(BASE)), load_case("near", load_world())
    for entry in base.entries():
        base.find(case, "scratch", 0, entry.path.name.removeprefix("seed=0-"))


def kept_plan() -> None:
    """Read a plan of the planner; a damaged one is searched for anew."""
    world = load_world()
    world.max_steps = 10
    best_known(load_case("near", world), world, Path(BASE) / ".plans")


def records() -> None:
    for record in read_study(Path("study")).records.values():
        for metric in METRICS.values():
            metric(record)


def study_plan() -> None:
    """Read a study's plan for its report, and plan the study again."""
    with contextlib.suppress(ConfigError):
        read_manifest(Path("study"))
    with contextlib.suppress(ConfigError):
        read_plan(Path("study/study.json"), "folder")
    config = to_study([*STUDY[1:], "output=study"])
    write_plan(plan_jobs(config), config)


def tables() -> None:
    """Read tables whose digests fit the damaged files, as somebody could write them."""
    place = Path("tables")
    if place.is_dir():
        with contextlib.suppress(ValueError, OSError, LookupError, TypeError):
            plan = json.loads(read_file(place / "study.json"))
            plan["kept"] = {n: hashlib.sha256(read_file(place / n)).hexdigest() for n in plan["kept"]}
            (place / "study.json").unlink()
            (place / "study.json").write_text(json.dumps(plan))
        assert all(record.folder.is_relative_to(place) for record, _, _ in read_tables(place).by_run())


def demonstrations() -> None:
    world = load_world()
    read_demonstrations(Path("demos"), load_case("met", world), world)


READERS: dict[str, tuple[str, Callable[[], object]]] = {
    "case": (MET, lambda: load_case(MET, load_world())),
    "settings": (f"{RUN}/config.yaml", lambda: settings_of(Path(RUN))),
    "configuration": (f"{RUN}/config.yaml", lambda: read_config(Path(RUN, "config.yaml"))),
    "result": (f"{RUN}/result.json", lambda: list(summarise(collect(Path(RUN))[0]))),
    "curve": (f"{RUN}/curve.csv", lambda: split(read_curve(Path(RUN)))),
    "weights": (WEIGHTS, weights),
    "checkpoint": (f"{STOPPED}/checkpoint/*.safetensors", checkpoints),
    "entry": (f"{BASE}/near/*/*/entry.json", case_base),
    "kept plan": (f"{BASE}/.plans/*.json", kept_plan),
    "record's result": ("study/*/*/*/*/result.json", records),
    "record's curve": ("study/*/*/*/*/curve.csv", records),
    "study": ("study/study.json", study_plan),
    "runs table": ("tables/runs.csv", tables),
    "curves table": ("tables/curves.csv.xz", tables),
    "tables' plan": ("tables/study.json", tables),
    "layers": ("tables/layers.csv", lambda: read_layers(Path("tables/layers.csv"))),
    "transfers": (
        "tables/transfers.csv",
        lambda: [t.commands() for t in read_transfers(Path("tables/transfers.csv"))],
    ),
    "demonstration": ("demos/met-001.json", demonstrations),
}
