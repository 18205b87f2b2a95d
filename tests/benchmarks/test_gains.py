"""Gains from a table of runs, and tables that are not whole."""

import lzma
from pathlib import Path

import numpy as np
import pytest

from benchmarks.gains import KEPT, KINDS, Gains, make_gains, read_runs
from ship_trl.config.errors import ConfigError

HEADING = "target,source,arm,seed,length,random,best_known,greedy,reached,source_greedy\n"
CASES = ("1", "2", "3")


def row(target: str, source: str, arm: str, seed: int, greedy: str, length: int = 30) -> str:
    kept = "50 0" if source else ""
    return f"{target},{source},{arm},{seed},{length},-100,100,{greedy},00011,{kept}\n"


def table() -> list[str]:
    """Return runs from scratch at a score of 0.5 and 0.7, sources, and transfers at 0.75."""
    rows = [row(case, "", "scratch", 0, "-300 0 0 0 0") for case in CASES]
    rows += [row(case, "", "scratch", 1, "-300 40 40 40 40") for case in CASES]
    rows += [row(case, "", "scratch", 0, "100 100 100 100 100", 90) for case in CASES]
    pairs = [(one, other) for one in CASES for other in CASES if one != other]
    return rows + [row(one, other, "FTW", seed, "0 50 50 50 50") for seed in (0, 1) for one, other in pairs]


def write(path: Path, rows: list[str]) -> Path:
    path.write_text(HEADING + "".join(rows))
    return path


def read_gains(path: Path) -> Gains:
    return make_gains(read_runs(path), CASES)


def test_gains_are_differences_of_scores_from_scratch(tmp_path: Path) -> None:
    found = read_gains(write(tmp_path / "runs.csv", table()))
    assert (found.cases, found.arms) == (CASES, ("FTW",))
    off = ~np.eye(3, dtype=bool)
    means = {kind: found.of("FTW", kind)[:, off].mean() for kind in KINDS}
    # Worse than random actions is no worse: before training the score of scratch is 0.
    assert means == pytest.approx({"area": 0.15, "jumpstart": 0.5, "end": 0.15, "success": 0})
    assert np.isnan(found.of("FTW")[:, ~off]).all()
    assert (found.of("FTW", KEPT)[:, off] == 0.5).all()


def test_cases_keep_their_order_in_any_table(tmp_path: Path) -> None:
    found = read_gains(write(tmp_path / "runs.csv", table()[::-1]))
    assert found.cases == CASES


def test_a_compressed_table_is_read_too(tmp_path: Path) -> None:
    text = write(tmp_path / "runs.csv", table()).read_bytes()
    (tmp_path / "runs.csv.xz").write_bytes(lzma.compress(text))
    one, other = (read_gains(tmp_path / name).of("FTW") for name in ("runs.csv", "runs.csv.xz"))
    assert np.array_equal(one, other, equal_nan=True)


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        (table()[:-1], "1 transfers are missing"),
        (table()[3:], "no runs from scratch"),
        ([], "no transfers"),
        ([*table()[:-1], row("3", "2", "FTW", 1, "0 50")], "wrong numbers"),
        ([*table()[:-1], row("3", "2", "FTW", 1, "0 x 1 1 1")], "could not convert"),
    ],
)
def test_a_table_that_is_not_whole_is_refused(rows: list[str], words: str, tmp_path: Path) -> None:
    if rows == table()[3:]:
        rows = [one for one in rows if ",scratch,1," not in one]
    with pytest.raises(ConfigError, match=words):
        read_gains(write(tmp_path / "runs.csv", rows))


def test_a_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"^runs: .*none\.csv cannot be read"):
        read_gains(tmp_path / "none.csv")
