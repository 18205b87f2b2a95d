"""Copies of a study that are refused in one line."""

import json
import lzma
from collections.abc import Callable
from pathlib import Path

import pytest

from ship_trl.study.tables import digest
from tests.command import files, keep, report

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
    "columns without end": (
        spoil("runs.csv", lambda d: b"run," * 100_000 + d),
        "runs.csv cannot be read: it has a column twice",
    ),
    "curves cut short, and signed": (spoil(FILES[0], lambda d: d[:-40]), "curves.csv.xz cannot be read"),
    "other columns": (
        spoil(FILES[0], lambda d: lzma.compress(b"a,b\n1,2\n")),
        "curves.csv.xz cannot be read",
    ),
    "no curves": (lambda copy: (copy / FILES[0]).unlink(), "curves.csv.xz is not the file"),
    "no plan": (lambda copy: (copy / FILES[2]).unlink(), "study.json is missing; every study has this plan"),
    "another plan": (
        lambda copy: (copy / FILES[2]).write_text('{"jobs": 3}') and None,
        "is not a study's plan",
    ),
    "a plan of no names": (
        spoil("study.json", lambda d: d.replace(b'"label": "high"', b'"label": ["high"]', 1), signed=False),
        "study.json is not a study's plan",
    ),
    "a study's plan": (
        lambda copy: (copy / FILES[2]).write_text('{"jobs": [], "settings": {}, "cases": {}}') and None,
        "is not the file that study.json was kept with",
    ),
    "a pair that leads out": (in_runs(",high,", ",../../x,"), "no run of a study is named"),
    "an arm that leads out": (in_runs(",FTW,", ",..,"), "no run of a study is named"),
    "a part that leads out": (in_runs("pairs,high", "../pairs,high"), "no run of a study is named"),
    "a seed that is no number": (in_runs(",FTW,0,", ",FTW,../0,"), "seed: must be a whole number"),
    "a run twice": (in_runs(",FTW,1,", ",FTW,0,"), "has no run, or a run twice"),
    "not text": (spoil("runs.csv", lambda d: b"\xff\xfe\x00" * 9), "runs.csv cannot be read"),
    "a bomb of brackets": (in_runs(",FTW,", f",{'[' * 100_000},"), "no run of a study is named"),
    "a return that is none": (in_curves(",collision,", ",collision,x"), "curves.csv.xz cannot be read"),
    "an episode that is lost": (
        in_curves("\n0,training,7,", "\n0,training,8,"),
        "curves.csv.xz cannot be read",
    ),
    "a row of no run": (in_curves("\n0,training,7,", "\n99,training,7,"), "its runs are not those of runs"),
    "an episode beyond counting": (
        in_curves("\n0,training,7,", "\n0,training,99999999999999999999999,"),
        "cannot be read",
    ),
    "a row of another kind": (in_curves("\n0,training,7,", "\n0,lesson,7,"), "cannot be read"),
}


@pytest.mark.parametrize("name", HOSTILE)
@pytest.mark.parametrize("command", ["restore", "report"])
def test_a_bad_copy_is_one_line_and_writes_nothing(
    name: str, command: str, copy: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change, said = HOSTILE[name]
    change(copy)
    before = files(tmp_path)
    capsys.readouterr()
    act, line, key = {
        "restore": (keep, ["--restore", str(copy), str(tmp_path / "a/new/one")], "copy"),
        "report": (report, [str(copy)], "folder"),
    }[command]
    with pytest.raises(SystemExit) as ended:
        act(line)
    told = capsys.readouterr()
    assert ended.value.code == 1 and told.out == ""
    assert told.err.startswith(f"ship_trl: {key}: ") and said in told.err and told.err.count("\n") == 1
    assert files(tmp_path) == before
