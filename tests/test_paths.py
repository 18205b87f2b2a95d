"""Files that matter are written beside and renamed."""

from pathlib import Path

import pytest

from ship_trl.paths import conf_dir, replacing


def test_conf_is_the_checkout_s() -> None:
    assert conf_dir() == Path(__file__).parent.parent / "conf"


def test_every_test_works_in_an_empty_folder() -> None:
    assert not list(Path.cwd().iterdir())


def test_a_file_is_replaced_whole(tmp_path: Path) -> None:
    path = tmp_path / "result.json"
    path.write_text("old")
    with replacing(path) as draft:
        draft.write_text("new")
        assert path.read_text() == "old" and draft.parent == path.parent and draft.suffix == path.suffix
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


def test_an_error_leaves_the_old_file_and_no_draft(tmp_path: Path) -> None:
    path = tmp_path / "result.json"
    path.write_text("old")

    def fail() -> None:
        with replacing(path) as draft:
            draft.write_text("half")
            raise RuntimeError

    with pytest.raises(RuntimeError):
        fail()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]
