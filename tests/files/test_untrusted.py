"""Untrusted files are not executed, name no other path, and are refused in one line."""

import json
import lzma
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
import yaml
from safetensors.torch import save_file
from torch import Generator

from ship_trl.config.errors import ConfigError, print_error
from ship_trl.config.types import World, plain
from ship_trl.explain.networks import read_config
from ship_trl.files.curve import RunError, read_curve
from ship_trl.files.record import read_run
from ship_trl.files.untrusted import MAX_YAML_BYTES, Bounded, read_yaml
from ship_trl.learn.network import DuelingNetwork
from ship_trl.policies.demonstrations import read_demonstration
from ship_trl.policies.reference import best_known, plan_name
from ship_trl.run.checkpoint import CheckpointError
from ship_trl.run.checkpoint import read as read_checkpoint
from ship_trl.run.folder import read_settings
from ship_trl.sim.cases import load_case
from ship_trl.study.manifest import read_plan
from ship_trl.study.tables import CURVES, KEPT, PLAN, RUNS, digest, read_tables
from ship_trl.transfer.casebase import CaseBase
from ship_trl.transfer.weights import load_weights, read_look
from tests.a_result import a_result
from tests.faults.damage import EXECUTED, Executes, hostile_files

KEY = "SHIP_TRL_A_SECRET"


def pickled(path: Path, protocol: int = pickle.DEFAULT_PROTOCOL) -> None:
    path.write_bytes(pickle.dumps(Executes(), protocol))


def pickled_as_text(path: Path) -> None:
    pickled(path, 0)


def compressed(path: Path) -> None:
    path.write_bytes(lzma.compress(pickle.dumps(Executes())))


def saved_by_torch(path: Path) -> None:
    torch.save({"conv1.weight": Executes()}, path)


def yaml_call(path: Path) -> None:
    path.write_bytes(hostile_files()["YAML tags"])


def yaml_object(path: Path) -> None:
    path.write_text("!!python/object/new:type\nargs: [z, !!python/tuple [], {extend: !!python/name:exec }]\n")


def tables_of(folder: Path) -> Any:
    """Read a folder's tables after writing valid digests, as an attacker can."""
    for name in (RUNS, CURVES):
        (folder / name).touch()
    plan = {"settings": {}, "cases": {}, "jobs": [], KEPT: {n: digest(folder / n) for n in (RUNS, CURVES)}}
    (folder / PLAN).write_text(json.dumps(plan))
    return read_tables(folder)


def a_network() -> DuelingNetwork:
    return DuelingNetwork(1, 7, Generator())


# Readers of untrusted files, with the name of the file.
READERS: dict[str, tuple[str, Callable[[Path, World], Any]]] = {
    "weights": ("policy.safetensors", lambda path, world: load_weights(path, a_network(), "policy")),
    "layers of weights": ("policy.safetensors", lambda path, world: read_look(path, "policy")),
    "checkpoint": ("1.safetensors", lambda path, world: read_checkpoint(path)),
    "result": ("result.json", lambda path, world: read_run(path.parent)),
    "curve": ("curve.csv", lambda path, world: read_curve(path.parent)),
    "case": ("mine.yaml", lambda path, world: load_case(str(path), world)),
    "configuration": ("config.yaml", lambda path, world: read_settings(path.parent)),
    "whole configuration": ("config.yaml", lambda path, world: read_config(path)),
    "demonstration": ("2-001.json", lambda path, world: read_demonstration(path, 7)),
    "plan of a study": (PLAN, lambda path, world: read_plan(path, "copy")),
    "runs of a study": (RUNS, lambda path, world: tables_of(path.parent)),
    "curves of a study": (CURVES, lambda path, world: tables_of(path.parent)),
}


@pytest.mark.parametrize(
    "write", [pickled, pickled_as_text, compressed, saved_by_torch, yaml_call, yaml_object]
)
@pytest.mark.parametrize("reader", READERS)
def test_no_reader_executes_what_it_reads(
    reader: str, write: Callable[[Path], None], tmp_path: Path, world: World
) -> None:
    name, read = READERS[reader]
    write(tmp_path / name)
    with pytest.raises((ConfigError, RunError, RunError, CheckpointError)) as caught:
        read(tmp_path / name, world)
    assert "\n" not in str(caught.value) and not Path(EXECUTED).exists()


@pytest.mark.parametrize("write", [pickled, pickled_as_text, compressed, yaml_call])
def test_skipped_files_are_not_executed(
    write: Callable[[Path], None], tmp_path: Path, world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Invalid entries of a case base are skipped; invalid plans are searched for again."""
    case = load_case("1", world)
    entry = tmp_path / "base" / "1" / "scratch" / "seed=0-abc" / "entry.json"
    entry.parent.mkdir(parents=True)
    write(entry)
    assert CaseBase(tmp_path / "base").entries() == []
    case.goal = [0.0, 500.0]  # there is no bundled plan for it
    monkeypatch.setattr("ship_trl.policies.reference._cached_plans", {})
    plan = tmp_path / "plans" / plan_name(case, world)
    plan.parent.mkdir()
    write(plan)
    assert best_known(case, world, plan.parent).goal
    assert json.loads(plan.read_text())["actions"] and not Path(EXECUTED).exists()


def test_unsafe_readers_execute_the_hostile_files(tmp_path: Path) -> None:
    """Otherwise the tests above could not fail."""
    for write, read in (
        (pickled, lambda path: pickle.loads(path.read_bytes())),
        (pickled_as_text, lambda path: pickle.loads(path.read_bytes())),
        (compressed, lambda path: pickle.loads(lzma.decompress(path.read_bytes()))),
        (saved_by_torch, lambda path: torch.load(path, weights_only=False)),
        (yaml_call, lambda path: yaml.load(path.read_text(), Loader=yaml.UnsafeLoader)),
    ):
        write(tmp_path / "file")
        read(tmp_path / "file")
        Path(EXECUTED).unlink()


ALIASES = "a: &a [1, 1]\n" + "".join(
    f"{c}: &{c} [{', '.join([f'*{b}'] * 9)}]\n" for b, c in zip("abcdefgh", "bcdefghi", strict=True)
)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f"ideal_path: ${{oc.env:{KEY}}}\n", "line 1: no interpolation"),
        (f'ideal_path: "\\x24{{oc.env:{KEY}}}"\n', "line 1: no interpolation"),
        (f"start: 1\n${{oc.env:{KEY}}}: 1\n", "line 2: no interpolation"),
        (ALIASES, "line 2: no alias"),
        ("a: &a [*a]\n", "line 1: no alias"),
        ("x: &x {y: 1}\nz: {<<: *x}\n", "line 2: no alias"),
        ("[" * 5000 + "]" * 5000, "nested too deeply"),
        ("a: " + "9" * 5000 + "\n", "integer string conversion"),
        ("a: 1\n" + "#" * MAX_YAML_BYTES, "larger than"),
        ("? [a]\n: 1\n", ""),
        ("a: !!int ship\n", "invalid literal"),
        ("a: !!timestamp x\n", "'NoneType'"),
    ],
    ids=lambda value: value[:12].strip(),
)
def test_yaml_is_values_and_no_more(
    text: str, said: str, tmp_path: Path, world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(KEY, "0123456789")
    path = tmp_path / "config.yaml"
    path.write_text(text)
    for read in (
        lambda: load_case(str(path), world),
        lambda: read_settings(tmp_path),
        lambda: read_config(path),
    ):
        with pytest.raises(ConfigError) as caught:
            read()
        message = str(caught.value)
        assert said in message and "0123456789" not in message and "\n" not in message


def test_yaml_without_them_is_what_omegaconf_makes_of_it(tmp_path: Path) -> None:
    path = tmp_path / "file.yaml"
    path.write_text("a: 1e-3\nb: [1, 2.5, yes]\nc: {d: ~, e: '$x {y}'}\n")
    assert read_yaml(path) == {"a": 0.001, "b": [1, 2.5, True], "c": {"d": None, "e": "$x {y}"}}


@pytest.mark.parametrize("stem", ["..", ".", "a\nb", "x" * 120])
def test_the_name_of_a_case_file_leads_nowhere(stem: str, tmp_path: Path, world: World) -> None:
    """Results lie in a folder of that name: `...yaml` would put them beside the output."""
    path = tmp_path / f"{stem}.yaml"
    path.write_text(yaml.safe_dump({k: v for k, v in plain(load_case("2", world)).items() if k != "name"}))
    with pytest.raises(ConfigError, match="its name cannot name a folder"):
        load_case(str(path), world)


@pytest.mark.parametrize("change", [{"max_steps": 10**9}, {"dt": float("nan")}, {"actions": [[1.0]]}])
def test_the_world_of_an_untrusted_file_is_checked(
    change: dict[str, Any], tmp_path: Path, world: World
) -> None:
    (tmp_path / "config.yaml").write_text(yaml.safe_dump({"world": plain(world) | change, "colour": False}))
    with pytest.raises(ConfigError, match=rf"^policy: \S+: world.{next(iter(change))}: must be"):
        read_settings(tmp_path)


@pytest.mark.parametrize("word", ["\x1b]0;title\x07", "a\nb", "\x9b2J", "\u202e"])
def test_no_text_of_a_file_controls_the_terminal(
    word: str, tmp_path: Path, world: World, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "result.json").write_text(json.dumps(a_result().to_json() | {"pair": word}))
    with pytest.raises(RunError, match="pair: must be plain text"):
        read_run(tmp_path)
    # A schema version is quoted.
    (tmp_path / "result.json").write_text(json.dumps({"pair": "", "schema_version": word}))
    with pytest.raises(RunError) as caught:
        read_run(tmp_path)
    print_error(str(caught.value))
    said = capsys.readouterr().err
    assert said.endswith("\n") and said[:-1].isprintable()


@pytest.mark.parametrize("length", [2**60, 2**27, 10**6, 0])
def test_a_header_of_any_length_is_refused(length: int, tmp_path: Path) -> None:
    path = tmp_path / "policy.safetensors"
    path.write_bytes(length.to_bytes(8, "little") + b"{}" * 100)
    with pytest.raises(ConfigError, match="is not a whole safetensors file"):
        load_weights(path, a_network(), "policy")


def test_a_small_file_asks_for_no_large_network(tmp_path: Path) -> None:
    """Tensors without a number take no room in a file, and the network of this one would take 15 GB."""
    layers = [[4096, 8, 4], [4096, 8, 1], [4096, 13, 1]]
    shapes = {
        "conv1.weight": (4096, 0, 8, 8),
        "conv2.weight": (4096, 0, 8, 8),
        "conv3.weight": (4096, 0, 13, 13),
    }
    tensors = {name: torch.empty(shape) for name, shape in shapes.items()} | {"shared.bias": torch.zeros(1)}
    path = tmp_path / "policy.safetensors"
    save_file(tensors, path, metadata={"ship_trl": json.dumps({"network": {"conv": layers, "hidden": 1}})})
    assert path.stat().st_size < 1000
    with pytest.raises(ConfigError, match=r"conv2\.weight has another shape"):
        read_look(path, "policy")


def test_decompression_is_bounded(tmp_path: Path) -> None:
    path = tmp_path / "zeros.xz"
    path.write_bytes(lzma.compress(bytes(10**6)))
    with lzma.open(path) as file, pytest.raises(ValueError, match="more than 1000 bytes"):
        Bounded(file, 1000).readall()
    with lzma.open(path) as file:
        assert len(Bounded(file, 10**6).readall()) == 10**6
