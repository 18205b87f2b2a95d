"""An earlier build is checked out, measured in a process of its own, and removed."""

from __future__ import annotations

import math
import subprocess
from pathlib import Path

import pytest

from benchmarks import before
from benchmarks.before import ROOT, main, measure, worktree
from ship_trl.config.errors import ConfigError


@pytest.fixture
def commit() -> str:
    """Return the present commit; skip where there is no checkout."""
    done = subprocess.run(
        ["git", "-C", ROOT, "rev-parse", "HEAD"], check=False, capture_output=True, text=True
    )
    if done.returncode:
        pytest.skip("no git checkout")
    return done.stdout.strip()


def test_a_build_is_measured_and_its_worktree_removed(commit: str, monkeypatch: pytest.MonkeyPatch) -> None:
    script = 'import ship_trl; print("told"); print(json.dumps({"file": ship_trl.__file__, "seed": SEED}))'
    monkeypatch.setitem(before.SCRIPTS, "import", script)
    with worktree(commit) as folder:
        assert measure("import", folder, 3) == {"file": f"{folder}/ship_trl/__init__.py", "seed": 3}
    assert not folder.exists()
    listed = subprocess.run(
        ["git", "-C", ROOT, "worktree", "list"], check=True, capture_output=True, text=True
    )
    assert str(folder) not in listed.stdout


@pytest.mark.parametrize("part", before.PARTS)
def test_every_part_is_python(part: str) -> None:
    compile(before.SCRIPTS[part], part, "exec")


def test_ratios_are_medians_of_the_rounds(capsys: pytest.CaptureFixture[str]) -> None:
    rounds = [
        {"old": {"speed": old}, "new": {"speed": new}} for old, new in ((1.0, 3.0), (2.0, 4.0), (2.0, 8.0))
    ]
    before.print_ratios("Speed", rounds, markdown=True)
    (row,) = [line for line in capsys.readouterr().out.splitlines() if "speed" in line]
    assert [cell.strip() for cell in row.strip("|").split("|")] == [
        "speed",
        "2 (1 to 2)",
        "4 (3 to 8)",
        "3.00",
    ]


def test_what_is_learned_is_tested_by_permutation(capsys: pytest.CaptureFixture[str]) -> None:
    values = [1.0, 2.0, 3.0, 4.0, 5.0]
    rounds = [{"old": {"apart": k, "even": k}, "new": {"apart": k + 9, "even": 6 - k}} for k in values]
    before.print_ratios("Learned", rounds, markdown=True, test=True)
    rows = [[cell.strip() for cell in line.split("|")] for line in capsys.readouterr().out.splitlines()]
    p = {row[1]: row[-2] for row in rows if len(row) > 2}
    assert (p["apart"], p["even"]) == (f"{2 / math.comb(10, 5):.2g}", "1")
    before.print_ratios("Learned", rounds[:1], markdown=True, test=True)
    assert capsys.readouterr().out.rstrip().endswith("| - |")


def test_rounds_that_miss_a_goal_have_no_ratio(capsys: pytest.CaptureFixture[str]) -> None:
    rounds = [{"old": {"to": old, "at": 1.0}, "new": {"to": 2.0, "at": 1.0}} for old in (4.0, math.inf)]
    before.print_ratios("Minutes", rounds, markdown=True)
    before.print_ratios("Minutes", rounds[1:], markdown=True)
    told = [line for line in capsys.readouterr().out.splitlines() if line.startswith("| to")]
    assert "0.50" in told[0] and "in no round by both" in told[1]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["speed"], "no part speed; allowed: import"),
        (["--commit", "no_such_commit", "import"], "^--commit: "),
    ],
)
def test_unknown_parts_and_commits_are_refused(words: list[str], told: str) -> None:
    with pytest.raises(ConfigError, match=told):
        main(words)
    assert Path(ROOT, "benchmarks").is_dir()
