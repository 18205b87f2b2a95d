"""The functions that read files, one after the other in one process: far more damages than by commands.

Survived: a reader gives something or raises what it says that it raises, within ten seconds and 3 GiB, and
nothing has been executed.
"""

import contextlib
import itertools
import json
import os
import random
import shutil
import signal
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import Any

from tests.faults.command import run
from tests.faults.damage import DAMAGES, EXECUTED, others
from tests.faults.files import OUTPUT, RUN, STOPPED, library, limited
from tests.faults.trial import Trial

LIMIT, BATCH = 10, 100


def read_cases(folder: Path) -> None:
    from ship_trl.sim.cases import load_case, load_world

    case = load_case("conf/case/met.yaml", load_world())
    assert len(case.fingerprint) == 12


def read_settings(folder: Path) -> None:
    from ship_trl.run.entries import settings_of

    settings_of(folder / RUN)


def read_configuration(folder: Path) -> None:
    from ship_trl.explain.networks import read_config

    read_config(folder / RUN / "config.yaml")


def read_results(folder: Path) -> None:
    from ship_trl.cli.results import summarise
    from ship_trl.run.results import collect

    found, _ = collect(folder / RUN)
    list(summarise(found))


def read_curves(folder: Path) -> None:
    from ship_trl.files.curve import CurveError, read_curve, split

    try:
        split(read_curve(folder / RUN))
    except CurveError:
        return


def read_records(folder: Path) -> None:
    from ship_trl.study.analysis.metrics import METRICS
    from ship_trl.study.analysis.study import read_study

    study = read_study(folder / "study")
    for record in study.records.values():
        for metric in METRICS.values():
            metric(record)


def read_weights(folder: Path) -> None:
    from torch import Generator

    from ship_trl.learn.network import DuelingNetwork
    from ship_trl.transfer.layers import load_weights, saved_network

    path = folder / RUN / "policy.safetensors"
    network = DuelingNetwork(1, 7, Generator(), saved_network(path, "policy"))
    network.load_state_dict(dict(load_weights(path, network, "policy")))


def read_checkpoints(folder: Path) -> None:
    """Read a stopped run's checkpoints, as the same command does."""
    from ship_trl.run.checkpoint import Checkpoints

    checkpoints = Checkpoints(folder / STOPPED)
    if not checkpoints.folder.is_dir():
        return
    about = checkpoints.about()
    assert about is not None  # there are two, and one is damaged
    # The command knows whose it looks for. Here one of the two places that say so may be damaged, not both.
    found = []
    for config_hash in (about.config_hash, owner_of(checkpoints.folder)):
        whole, damaged = checkpoints.read(config_hash)
        checkpoints.has_other_owner(config_hash)
        found.append(whole)
        assert not any("\n" in reason for reason in damaged.values())
    assert any(whole is not None for whole in found)


def owner_of(folder: Path) -> str:
    """Read whose checkpoints a folder holds, as far as it can be read."""
    from ship_trl.files.disk import read_file
    from ship_trl.run.checkpoint import OWNER

    try:
        return read_file(folder / OWNER, most=1000).decode()
    except (OSError, ValueError):
        return ""


def read_case_base(folder: Path) -> None:
    from ship_trl.sim.cases import load_case, load_world
    from ship_trl.transfer.casebase import CaseBase

    base, case = CaseBase(folder / OUTPUT / "case_base"), load_case("near", load_world())
    for entry in base.entries():
        base.find(case, "scratch", 0, entry.path.name.removeprefix("seed=0-"))
    base.representative(case)


def read_plans(folder: Path) -> None:
    from ship_trl.sim.cases import load_case, load_world
    from ship_trl.sim.reference import _read

    world = load_world()
    world.max_steps = 10
    for path in (folder / OUTPUT / "case_base/.plans").glob("*.json"):
        _read(path, load_case("near", world), world)


def read_study_plan(folder: Path) -> None:
    """Read a study's plan for its report, and plan the study again, as the same command does."""
    from ship_trl.config.errors import ConfigError
    from ship_trl.study.analysis.study import Study
    from ship_trl.study.plan.config import to_study
    from ship_trl.study.plan.jobs import plan_jobs
    from ship_trl.study.plan.manifest import begun_with, read_plan, write_plan
    from ship_trl.study.report.write import missing
    from ship_trl.study.rules import told
    from tests.faults.runs import STUDY

    place = folder / "study"
    with contextlib.suppress(ConfigError):
        told(begun_with(place)[1])
    missing(place, Study({}))
    with contextlib.suppress(ConfigError):
        read_plan(place / "study.json", "folder")
    config = to_study([*STUDY, f"output={place}"])
    write_plan(plan_jobs(config), config)


def read_kept(folder: Path) -> None:
    """Read tables whose digests are those of the damaged files: somebody made them on purpose."""
    import hashlib

    from ship_trl.files.disk import read_file
    from ship_trl.study.records.tables import read_tables

    place = folder / "tables"
    if not place.is_dir():
        return
    plan = json.loads((place / "study.json").read_text())
    for name in plan["kept"]:
        with contextlib.suppress(OSError):
            plan["kept"][name] = hashlib.sha256(read_file(place / name)).hexdigest()
    (place / "study.json").unlink()
    (place / "study.json").write_text(json.dumps(plan))
    for record, _, _ in read_tables(place).by_run():
        assert record.folder.is_relative_to(place)


def read_tables_plan(folder: Path) -> None:
    from ship_trl.study.records.tables import read_tables

    read_tables(folder / "tables")


def read_layers_table(folder: Path) -> None:
    from ship_trl.study.records.layers import read_layers

    read_layers(folder / "tables/layers.csv")


def read_measured(folder: Path) -> None:
    """Read what was measured, and write the commands that it stands for."""
    from ship_trl.transfer.measured import read_transfers

    for transfer in read_transfers(folder / "measured/transfers.csv"):
        transfer.commands()


def read_earlier(folder: Path) -> None:
    from ship_trl.study.report.tables import read_verdicts

    read_verdicts(folder / "measured/claims.csv")


def read_demonstrated(folder: Path) -> None:
    from ship_trl.policies.demonstrations import read_demonstrations
    from ship_trl.sim.cases import load_case, load_world

    world = load_world()
    read_demonstrations(folder / "shown", load_case("met", world), world)


READERS: dict[str, tuple[Callable[[Path], None], str]] = {
    "case": (read_cases, "conf/case/met.yaml"),
    "settings": (read_settings, f"{RUN}/config.yaml"),
    "configuration": (read_configuration, f"{RUN}/config.yaml"),
    "result": (read_results, f"{RUN}/result.json"),
    "curve": (read_curves, f"{RUN}/curve.csv"),
    "record's result": (read_records, "study/*/*/*/*/result.json"),
    "record's curve": (read_records, "study/*/*/*/*/curve.csv"),
    "weights": (read_weights, f"{RUN}/policy.safetensors"),
    "checkpoint": (read_checkpoints, f"{STOPPED}/checkpoint/*.safetensors"),
    "checkpoints' owner": (read_checkpoints, f"{STOPPED}/checkpoint/config_hash"),
    "entry": (read_case_base, f"{OUTPUT}/case_base/near/*/*/entry.json"),
    "plan": (read_plans, f"{OUTPUT}/case_base/.plans/*.json"),
    "study": (read_study_plan, "study/study.json"),
    "runs table": (read_kept, "tables/runs.csv"),
    "curves table": (read_kept, "tables/curves.csv.xz"),
    "tables' plan": (read_tables_plan, "tables/study.json"),
    "layers": (read_layers_table, "tables/layers.csv"),
    "transfers": (read_measured, "measured/transfers.csv"),
    "verdicts": (read_earlier, "measured/claims.csv"),
    "demonstration": (read_demonstrated, "shown/met-001.json"),
}


class SlowError(BaseException):
    """A reader takes too long."""


def of_readers(rng: random.Random, place: Path) -> Iterator[Trial]:
    """Read damaged files, a hundred in each child."""
    for number in itertools.count():
        name = sorted(READERS)[number % len(READERS)]
        yield batch(name, rng.getrandbits(32), place / str(number))


def batch(name: str, seed: int, folder: Path, count: int = BATCH) -> Trial:
    """Read as many damaged copies in a child."""
    folder.mkdir(parents=True)

    def work() -> None:
        limited(count * LIMIT)()
        for number in range(count):
            try_one(name, random.Random(f"{seed} {number}"), folder / str(number))
        os._exit(0)

    library()
    others()  # here, and not anew in every child
    done = run(folder=folder, before=work, limit=count * LIMIT)
    lost = (
        "" if done.code == 0 and not done.out else f"{done.code} {done.out.strip()[-3000:]} {done.err[-300:]}"
    )
    if not lost:
        shutil.rmtree(folder)
    return Trial(f"{folder}: {name}, seed {seed}", lost, count)


def try_one(name: str, rng: random.Random, folder: Path) -> None:
    """Read a damaged copy; what is wrong is said on stdout."""
    from ship_trl.config.errors import ConfigError

    reader, pattern = READERS[name]
    top = pattern.split("/")[0]
    folder.mkdir()
    shutil.copytree(library() / "conf", folder / "conf", copy_function=os.link)
    if top != "conf":
        shutil.copytree(library() / top, folder / top, copy_function=os.link)
    words: Any = rng.choice(DAMAGES)(rng.choice(sorted(folder.glob(pattern))), rng)
    os.chdir(folder)

    def slow(number: int, frame: FrameType | None) -> None:
        raise SlowError

    signal.signal(signal.SIGALRM, slow)
    signal.alarm(LIMIT)
    wrong = ""
    try:
        reader(folder)
    except ConfigError as error:
        wrong = "" if len(str(error).splitlines()) == 1 else f"not one line: {error}"
    except BaseException as error:
        last = traceback.extract_tb(error.__traceback__)
        ours = [f for f in last if "ship_trl/" in f.filename or "tests/" in f.filename][-1]
        wrong = f"{type(error).__name__}: {str(error)[:100]} at {Path(ours.filename).name}:{ours.lineno}"
    finally:
        signal.alarm(0)
        os.chdir("/")
    if Path(folder, EXECUTED).exists():
        wrong += "; something was executed"
    if wrong:
        print(f"{folder}: {words}: {wrong}", flush=True)  # noqa: T201
    else:
        shutil.rmtree(folder)
