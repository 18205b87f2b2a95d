"""Policies and targets of a command line: a run meets encounters of other tools in its own world."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from ship_trl.config.bounds import NAUTICAL_MILE
from ship_trl.config.errors import ConfigError
from ship_trl.config.types import Perturbation, Situations
from ship_trl.run import entries
from ship_trl.run.entries import find_entries
from ship_trl.sim.cases import load_world
from tests.foreign.test_suites import OWN, save
from tests.formats.test_maritime_schema import ship, situation


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A run whose safe distance is 60 m, which stood for half a mile."""
    folder = tmp_path / "run"
    folder.mkdir()
    for name in ("policy.safetensors", "policy_last.safetensors"):
        (folder / name).touch()
    target = save(tmp_path / "one.json", situation(OWN, ship(56.06, 11.0, sog=12, cog=180)))
    claim = SimpleNamespace(episode_return=1.0)
    found = SimpleNamespace(folder=folder, target=str(target), label="one", name="scratch", seed=0)
    found.best = found.final = claim
    settings = load_world({"safe_distance": 60.0}), False, Perturbation(), Situations(safe=0.5)
    monkeypatch.setattr(entries, "collect", lambda _: [found])
    monkeypatch.setattr(entries, "read_settings", lambda _: settings)
    return str(folder)


@pytest.mark.parametrize(
    ("words", "safe", "claimed"),
    [
        ([], 0.5, 1.0),
        (["situations.ships=2"], 0.5, None),
        (["situations.safe=0.3"], 0.3, None),
        (["target=one.json"], 0.3, None),
        (["target=one.json", "situations.safe=0.4"], 0.4, None),
    ],
    ids=lambda value: "-".join(value) if isinstance(value, list) else "",
)
def test_the_safe_distance_of_a_run_stands_for_that_at_sea(
    run: str, words: list[str], safe: float, claimed: float | None
) -> None:
    others = ["vo"] if words and words[0].startswith("target") else []
    found = find_entries([run, *others, *words], False)
    assert len(found) == 2 + len(others)
    for entry in found:
        (case,) = entry.suite.cases
        assert case.scale is not None and case.scale.length == pytest.approx(safe * NAUTICAL_MILE / 60)
        assert entry.world.safe_distance == 60 and entry.claimed == claimed


def test_reading_without_a_file_of_another_tool_is_refused() -> None:
    for words in (["keep_course", "target=4"], ["pretrained:4"]):
        with pytest.raises(ConfigError, match=r"situations\.safe: no target is a file of another tool"):
            find_entries([*words, "situations.safe=0.5"], False)
