"""Inputs drawn by Hypothesis: command-line words, configurations and case files.

Passed: an input is used, with finite numbers, or refused in one line that begins with its key or file, within
the time limit; no file is left or changed.
"""

import contextlib
import copy
import itertools
import os
import random
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import yaml
from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hypothesis import HealthCheck, given, seed, settings
from hypothesis import strategies as st
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from ship_trl.cli.errors import hydra_errors, refusals
from ship_trl.config.checks import to_config
from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import conf_dir
from ship_trl.config.types import plain
from ship_trl.run.plan import make_run
from ship_trl.sim.cases import load_case, load_world
from ship_trl.study.manifest import run_config
from ship_trl.study.plan import to_study
from tests.faults.damage import ODD, hostile_files
from tests.faults.judge import RUN_KEYS, STUDY_KEYS, check_line, guarded, roll_out
from tests.faults.samples import CASES
from tests.faults.trial import Trial

BATCH = 200

# What people type: numbers out of range, words of YAML, Hydra's grammar, OmegaConf and the shell.
PLAIN = """
    nan .nan -inf 1e400 1e308 1e39 1e-320 0 -1 0.5 007 0x10 1_000 1:30 2001-01-01 1000000000000 true
    null ~ [] {} [1] [[1]] {a:1} [[nan,0]] [null] '' " ' \u65e5 \u202e ${oc.env:HOME} ${nothing}
    ${output} ${learn} ${ ${oc.decode:'[1,2]'} ${.} ??? \\ a=b 1,2 choice(1,2) range(0,1e9) glob(*) @ ..
    / /dev/zero /proc/self/mem cuda:x cpu:0 all - + 1 2 4 10 smoke paper scratch finetune random learned
    [high] [scratch,FTW]
"""
LONG = ("[" * 50, "9" * 400, "9" * 5000, "a" * 300, "a/" * 3000)
WORDS = ("", *PLAIN.split(), *LONG, "'a b'", "a\nb", "a\x1b[31mb", "\ud800")
STRANGE_KEYS = """. learn. learn..lr hydra.run.dir hydra/launcher world@learn _target_ defaults
    world.actions[0] network.conv.0 layers.a \u00fc ${seed} _global_"""
texts = st.text(st.characters(codec=None, exclude_characters="\x00"), max_size=12)
numbers = st.one_of(st.floats(), st.integers(-3, 2000), st.floats(-40, 40).map(lambda power: 10.0**power))
typed = st.one_of(st.sampled_from(WORDS), texts, numbers.map(repr))
values = st.one_of(st.sampled_from(WORDS), st.sampled_from(ODD), texts, numbers)
GROUPS = {path.name for path in conf_dir().iterdir() if path.is_dir()}
LINES = (("+pair=high", "layers=3"), ("target=1", "method=scratch"), ("source=3", "target=2", "layers=2"))
RIGHT = "seed=7 colour=true profile=quick learn.gamma=0.5 learn.loss=huber world.dt=0.5 logger=csv"
words = st.builds(
    "{}{}={}".format,
    st.sampled_from(["", "", "", "", "+", "++", "~"]),
    st.one_of(st.sampled_from([*sorted(RUN_KEYS | GROUPS), *STRANGE_KEYS.split()]), texts),
    typed,
)
more = st.lists(st.one_of(words, words, st.sampled_from(RIGHT.split()), texts), max_size=3)
lines = st.builds(lambda line, others: [*line, *others], st.sampled_from(LINES), more)
study_words = st.one_of(
    st.builds("{}={}".format, st.sampled_from(sorted(STUDY_KEYS)), typed),
    st.sampled_from(("seeds=2", "profile=smoke", "pairs=[high]")),
    texts,
)


def compose_line(line: list[str]) -> Any:
    """Compose a configuration as the command does."""
    GlobalHydra.instance().clear()
    with initialize_config_dir(str(conf_dir()), version_base="1.3"):
        return compose("config", line)


def try_line(line: list[str]) -> bool:
    """Give a command line to Hydra, and plan and roll out its run."""
    os.environ.pop("HYDRA_FULL_ERROR", None)
    with guarded(Path.cwd()) as err:
        try:
            with hydra_errors():
                values = compose_line(line)
                with refusals():
                    config = to_config(values)
                    run = make_run(config)
        except SystemExit as ended:
            return refused(ended, err.getvalue(), line)
        roll_out(run.target, config.world, config.colour)
    return True


def try_study(line: list[str]) -> bool:
    """Give words to a study."""
    with guarded(Path.cwd()) as err:
        try:
            with refusals():
                run_config(to_study(line))
        except SystemExit as ended:
            return refused(ended, err.getvalue(), line)
    return True


def refused(ended: SystemExit, err: str, line: list[str]) -> bool:
    """Check how a command line was refused; return False, for it was not used."""
    assert ended.code == 1 and err.startswith("ship_trl: ") and err.endswith("\n"), (ended.code, err)
    check_line(err.removeprefix("ship_trl: ")[:-1], " ".join(line))
    return False


@cache
def good_config() -> dict[str, Any]:
    """Return a configuration that is accepted."""
    return plain(compose_line(["target=2", "method=scratch", "profile=smoke"]))


def leaves(tree: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """List the paths of all values of a tree."""
    inner = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    return ([path] if path else []) + [found for key, value in inner for found in leaves(value, (*path, key))]


@st.composite
def changed(draw: st.DrawFn, good: Callable[[], Any]) -> Any:
    """Scale, replace, remove or add up to three values of a tree."""
    tree = copy.deepcopy(good())
    for _ in range(draw(st.integers(1, 3))):
        *above, key = draw(st.sampled_from(leaves(tree) or [("new",)]))
        place = tree
        for part in above:
            place = place[part]
        how = draw(st.sampled_from(["scale", "scale", "replace", "replace", "remove", "add"]))
        if how == "remove":
            del place[key]
        elif how == "add" and isinstance(place, dict):
            place[draw(texts)] = draw(values)
        elif how == "scale" and type(place[key]) in (int, float):
            place[key] = draw(st.floats(-9, 9).map(lambda power: 10.0**power)) * min(place[key], 1e12)
        else:
            place[key] = draw(values)
    return tree


def try_config(tree: Any) -> bool:
    """Check a configuration that a program made, and roll out its case."""
    with guarded(Path.cwd()):
        try:
            config = to_config(OmegaConf.create(tree))
            run = make_run(config)
        except OmegaConfBaseException:  # OmegaConf itself cannot hold it
            return False
        except ConfigError as error:
            check_line(str(error), str(tree))
            return False
        roll_out(run.target, config.world, config.colour)
    return True


case_trees = changed(lambda: yaml.safe_load(CASES["met"]))
case_texts = case_trees.map(lambda tree: yaml.safe_dump(tree, sort_keys=False))
hostile = st.randoms(use_true_random=True).map(lambda rng: rng.choice(list(hostile_files().values())))
case_files = st.one_of(
    *[case_texts.map(lambda text: text.encode("utf-8", "surrogatepass"))] * 4,
    st.binary(max_size=200),
    hostile,
)


def try_case(content: bytes) -> bool:
    """Read a case file, and roll out its case."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mine.yaml"
        path.write_bytes(content)
        with guarded(Path(folder)):
            try:
                case = load_case(str(path), load_world())
            except ConfigError as error:
                line = str(error)
                assert line.startswith(f"{path}: "), line
                if f"{path}: must " not in line:
                    check_line(line, content.decode(errors="replace"))
                return False
            roll_out(case, load_world())
    return True


KINDS: dict[str, tuple[st.SearchStrategy[Any], Callable[[Any], bool]]] = {
    "command lines": (lines, try_line),
    "studies": (st.lists(study_words, min_size=1, max_size=3), try_study),
    "configurations": (changed(good_config), try_config),
    "case files": (case_files, try_case),
}


# How many examples of each kind are quick enough for every test run.
EXAMPLES = dict(zip(KINDS, (40, 25, 25, 60), strict=True))


def try_inputs(kind: str, examples: int, number: int | None = None) -> Counter[bool]:
    """Try so many inputs of a kind; return how many were used and refused. A number draws other ones."""
    strategy, attempt = KINDS[kind]
    counts: Counter[bool] = Counter()
    options: dict[str, Any] = {} if number is None else {"derandomize": False, "database": None}

    @settings(max_examples=examples, deadline=None, suppress_health_check=list(HealthCheck), **options)
    @given(strategy)
    def one(drawn: Any) -> None:
        counts[attempt(drawn)] += 1

    (one if number is None else seed(number)(one))()
    return counts


def trials(rng: random.Random, place: Path) -> Iterator[Trial]:
    """Try a batch of each kind in turn; a failure is shrunk."""
    place.mkdir(exist_ok=True)
    for kind in itertools.cycle(KINDS):
        number = rng.getrandbits(32)
        problem = ""
        try:
            with contextlib.chdir(place):
                try_inputs(kind, BATCH, number)
        except Exception as error:
            shown = "; ".join(getattr(error, "__notes__", []))
            problem = f"{type(error).__name__}: {str(error)[:500]}: {shown[:1000]}"
        yield Trial(f"{kind}, seed {number}", problem, BATCH)
