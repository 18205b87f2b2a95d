"""Files of suites: found by name, here or bundled, based on others, or refused in one line."""

from dataclasses import replace
from pathlib import Path

import pytest

from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import conf_dir
from ship_trl.config.types import World
from ship_trl.sim.cases import shadowing_file
from ship_trl.sim.suites import load_suite, profile_of


def test_an_unknown_suite_is_refused(world: World) -> None:
    with pytest.raises(ConfigError, match="suite: no case or suite everything; allowed: 1, 2"):
        load_suite("everything", world)


def test_a_suite_of_the_working_directory_comes_before_a_bundled_one(
    world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bundled = load_suite("traffic", world).traffic
    (tmp_path / "conf/suite").mkdir(parents=True)
    text = (conf_dir() / "suite/traffic.yaml").read_text().replace("reacting: 0 ", "reacting: 1 ")
    (tmp_path / "conf/suite/traffic.yaml").write_text(text)
    (tmp_path / "conf/suite/two.yaml").write_text("cases: ['1', '2']")
    monkeypatch.chdir(tmp_path)
    own = load_suite("traffic", world).traffic
    assert bundled is not None and own is not None and (bundled.reacting, own.reacting) == (0, 1)
    assert [case.name for case in load_suite("two", world).cases] == ["1", "2"]
    (tmp_path / "conf/suite/two.yaml").write_text("cases: ['1', '22']")
    with pytest.raises(ConfigError, match=r"^conf/suite/two.yaml: cases: no case 22"):
        load_suite("two", world)
    (tmp_path / "conf/suite/two.yaml").write_text("cases: ['1'")
    for read in (lambda: load_suite("two", world), lambda: profile_of("two")):
        with pytest.raises(ConfigError, match=r"^conf/suite/two.yaml: not readable as YAML: "):
            read()
    assert shadowing_file("suite", "traffic") == Path("conf/suite/traffic.yaml")
    assert shadowing_file("suite", "two") is None


def test_a_suite_takes_what_it_leaves_out_from_the_one_it_is_based_on(
    world: World, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "conf/suite").mkdir(parents=True)
    monkeypatch.chdir(tmp_path)
    own = tmp_path / "conf/suite/own.yaml"
    own.write_text("based_on: traffic\ntraffic:\n  reacting: 0.5\n  ships: [0, 1]\n")
    below, above = load_suite("traffic", world).traffic, load_suite("own", world).traffic
    assert below is not None and above == replace(below, reacting=0.5, ships=[0, 1])
    assert profile_of("own") == "traffic"
    for wrong in ("nothing", "own", "traffic_dense", "[1, 2]", "../suite/traffic", "traffic\ntraffic: [1]"):
        own.write_text(f"based_on: {wrong}\n")
        with pytest.raises(ConfigError, match=r"^conf/suite/own.yaml: based_on: "):
            load_suite("own", world)
    own.write_text("based_on: traffic_test\n")
    assert len(load_suite("own", world).cases) == 500
    # A bundled suite keeps its base, and a file may be based on the bundled one of its name.
    (tmp_path / "conf/suite/traffic.yaml").write_text("based_on: traffic\ntraffic:\n  ships: [1]\n")
    ours, theirs = load_suite("traffic", world).traffic, load_suite("traffic_reacting", world).traffic
    assert ours == replace(below, ships=[1]) and theirs == replace(below, reacting=1)
