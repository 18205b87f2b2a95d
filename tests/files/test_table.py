"""Untrusted tables are read whole, or refused in one line."""

from pathlib import Path

import pytest

from ship_trl.config.errors import ConfigError
from ship_trl.files.untrusted import Cells, read_table


def read(path: Path, most: int = 1000) -> list[Cells]:
    def make(cells: Cells) -> Cells:
        if cells["a"] == "bad":
            raise ValueError("a bad row")
        return cells

    return read_table(path, ("a", "b"), make, most, "--option", "a table of ours")


def test_a_table_has_its_columns_and_may_have_others(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text('b,a,c\n1,"x\ny",3\n')
    assert read(path) == [{"b": "1", "a": "x\ny", "c": "3"}]
    path.write_text("a,b\n")
    assert read(path) == []
    # As spreadsheets begin a file.
    path.write_bytes(b"\xef\xbb\xbfa,b\n1,2\n")
    assert read(path) == [{"a": "1", "b": "2"}]


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"", "column 'a'"),
        (b"a\n1\n", "column 'b'"),
        (b"a,b\n1\n", "cells"),
        (b"a,b\n1,2,3\n", "cells"),
        (b'a,b\n1,"2\n', "unexpected end"),
        (b"a,b\n1,\xff\n", "utf-8"),
        (b"a,b\nbad,1\n", "a bad row"),
        (b"a,b,a\n1,2,3\n", "a column twice"),
    ],
)
def test_a_wrong_table_is_refused_in_one_line(content: bytes, why: str, tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_bytes(content)
    with pytest.raises(ConfigError, match=why) as caught:
        read(path)
    said = str(caught.value)
    assert said.startswith(f"--option: {path} is not a table of ours: ") and "\n" not in said


def test_an_unreadable_or_large_table_is_named(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    with pytest.raises(ConfigError, match="cannot be read: No such file") as caught:
        read(path)
    assert str(caught.value).startswith(f"--option: {path} ")
    path.write_text("a,b\n" + "1,2\n" * 100)
    assert len(read(path)) == 100
    with pytest.raises(ConfigError, match="--option: "):
        read(path, most=100)
