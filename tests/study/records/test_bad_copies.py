"""Copies of a study that are refused in one line."""

import json
import lzma
from collections.abc import Callable
from pathlib import Path

import pytest

from ship_trl.study.tables import digest
from tests.command import files, keep

FILES = ["curves.csv.xz", "runs.csv", "study.json"]


def spoil(name: str, change: Callable[[bytes], bytes], signed: bool = True) -> Callable[[Path], None]:
    """Change a file of a copy; signed, as somebody would who knows the program."""

    def act(copy: Path) -> None:
        (copy / name).write_bytes(change((copy / name).read_bytes()))
        if signed:
            plan = json.loads((copy / "study.json").read_text())
            plan["kept"] = {each: digest(copy / each) for each in FILES[:2]}
            (copy / "study.json").write_text(json.dumps(plan))

    return act


def in_runs(old: str, new: str) -> Callable[[Path], None]:
    return spoil("runs.csv", lambda data: data.replace(old.encode(), new.encode(), 1))


def in_curves(old: str, new: str) -> Callable[[Path], None]:
    return spoil(
        "curves.csv.xz",
        lambda data: lzma.compress(lzma.decompress(data).replace(old.encode(), new.encode(), 1)),
    )


HOSTILE = {
    "cut short": (
        spoil("runs.csv", lambda d: d[:-9], signed=False),
        "runs.csv is not the file that study.json",
    ),
    "curves cut short, and signed": (spoil(FILES[0], lambda d: d[:-40]), "curves.csv.xz cannot be read"),
    "no curves": (lambda copy: (copy / FILES[0]).unlink(), "curves.csv.xz is not the file"),
    "no plan": (lambda copy: (copy / FILES[2]).unlink(), "study.json is missing; every study has this plan"),
    "another plan": (
        lambda copy: (copy / FILES[2]).write_text('{"jobs": 3}') and None,
        "is not a study's plan",
    ),
    "a pair that leads out": (in_runs(",high,", ",../../x,"), "no run of a study is named"),
    "a seed that is no number": (in_runs(",FTW,0,", ",FTW,../0,"), "seed: must be a valid integer"),
    "a run twice": (in_runs(",FTW,1,", ",FTW,0,"), "has no run, or a run twice"),
    "a return that is none": (in_curves(",collision,", ",collision,x"), "curves.csv.xz cannot be read"),
    "an episode that is lost": (
        in_curves("\n0,training,7,", "\n0,training,8,"),
        "curves.csv.xz cannot be read",
    ),
    "a row of no run": (in_curves("\n0,training,7,", "\n99,training,7,"), "its runs are not those of runs"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_bad_copy_is_one_line_and_writes_nothing(
    name: str, copy: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change, said = HOSTILE[name]
    change(copy)
    before = files(tmp_path)
    capsys.readouterr()
    with pytest.raises(SystemExit) as ended:
        keep(["--restore", str(copy), str(tmp_path / "a/new/one")])
    told = capsys.readouterr()
    assert ended.value.code == 1 and told.out == ""
    assert told.err.startswith("ship_trl: copy: ") and said in told.err and told.err.count("\n") == 1
    assert files(tmp_path) == before
