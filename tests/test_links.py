"""No command writes or reads through a link inside its output."""

from pathlib import Path

import pytest

from ship_trl.config.errors import ConfigError
from ship_trl.run.folder import open_folder
from ship_trl.run.plan import make_run
from ship_trl.run.wandb_tracker import begin_wandb
from tests.a_result import a_result
from tests.command import files, ship_trl
from tests.config.test_config import composed


@pytest.fixture
def private(tmp_path: Path) -> Path:
    """A folder that no command may change."""
    folder = tmp_path / "private"
    (folder / "scratch" / "seed=0").mkdir(parents=True)
    (folder / "notes").write_text("mine")
    (folder / "scratch" / "seed=0" / "notes").write_text("mine")
    return folder


@pytest.mark.parametrize("linked", ["1", "1/scratch", "1/scratch/seed=0"])
def test_no_run_is_written_through_a_link(linked: str, tmp_path: Path, private: Path) -> None:
    before, link = files(private), tmp_path / "out" / linked
    link.parent.mkdir(parents=True)
    link.symlink_to(private)
    config = composed("target=1", "method=scratch", "overwrite=true", f"output={tmp_path / 'out'}")
    with pytest.raises(ConfigError, match=rf"^output: {link} is a link; allowed: only output= itself"):
        make_run(config)
    assert files(private) == before


def test_a_finished_run_behind_a_link_is_not_shown_either(tmp_path: Path) -> None:
    config = composed("target=1", "method=scratch", f"output={tmp_path / 'out'}")
    run = make_run(config)
    run.folder.mkdir(parents=True)
    a_result(config_hash=run.config_hash).write(run.folder)
    make_run(config)
    (tmp_path / "out/1").rename(tmp_path / "1")
    (tmp_path / "out/1").symlink_to(tmp_path / "1")
    with pytest.raises(ConfigError, match=rf"^output: {tmp_path / 'out/1'} is a link"):
        make_run(config)


def test_the_output_itself_may_be_a_link_and_links_in_a_run_are_not_followed(
    tmp_path: Path, private: Path
) -> None:
    before = files(private)
    (tmp_path / "disk").mkdir()
    (tmp_path / "out").symlink_to(tmp_path / "disk")
    config = composed("target=1", "method=scratch", "overwrite=true", f"output={tmp_path / 'out'}")
    run = make_run(config)
    run.folder.mkdir(parents=True)
    (run.folder / "inside").symlink_to(private)
    (run.folder / "config.yaml").symlink_to(private / "notes")
    open_folder(run)
    assert files(private) == before
    assert sorted(path.name for path in run.folder.iterdir()) == ["checkpoint", "config.yaml"]
    assert not (run.folder / "config.yaml").is_symlink()


@pytest.mark.parametrize("linked", [".locks", "wandb"])
def test_nothing_beside_the_runs_is_written_through_a_link(
    linked: str, tmp_path: Path, private: Path
) -> None:
    before, link = files(private), tmp_path / "out" / linked
    link.parent.mkdir(parents=True)
    link.symlink_to(private)
    config = composed("target=1", "method=scratch", "logger=wandb", f"output={tmp_path / 'out'}")
    with pytest.raises(ConfigError, match=rf"{link} is a link; allowed: "):
        begin_wandb(make_run(config))
    assert files(private) == before


def test_a_grid_does_not_write_through_a_link(tmp_path: Path, private: Path) -> None:
    before = files(private)
    (tmp_path / "out").mkdir()
    (tmp_path / "out/multirun.yaml").symlink_to(private / "notes")
    line = ("-m", "target=1,2", "method=scratch", "profile=smoke", "output=out")
    said = ship_trl(*line, folder=tmp_path, code=1).stderr
    assert said == "ship_trl: output: out/multirun.yaml is a link; allowed: only output= itself may be one\n"
    assert files(private) == before
