"""The table of measured transfers is untrusted."""

import shlex
from pathlib import Path

import pytest

from ship_trl.config.errors import ConfigError
from ship_trl.config.types import World
from ship_trl.files.record import read_run
from ship_trl.sim.cases import load_case
from ship_trl.study.transfers import COLUMNS, Transfer, read_transfers, transfers_to
from tests.command import ship_trl
from tests.pasted import ODD, composed_values

ROW = ("3", "4", "abc", "def", "quick", "FT3", "", "15", "0.05", "0.03", "0.07")


def write(path: Path, *rows: tuple[str, ...]) -> Path:
    path.write_text("".join(",".join(row) + "\n" for row in (COLUMNS, *rows)))
    return path


def test_a_row_is_a_transfer_with_the_command_that_repeats_it(tmp_path: Path) -> None:
    (found,) = read_transfers(write(tmp_path / "t.csv", ROW))
    assert (found.gain, found.low, found.seeds, found.epsilon_start) == (0.05, 0.03, 15, None)
    assert found.commands() == ["python -m ship_trl profile=quick source=3 target=4 +arm=FT3"]


@pytest.mark.long
def test_a_source_is_trained_with_the_default_exploration(tmp_path: Path) -> None:
    row = ("2", "new", "abc", "def", "smoke", "FTW", "0.1", "15", "0.05", "0.03", "0.07")
    (found,) = read_transfers(write(tmp_path / "t.csv", row))
    for command in found.commands():
        ship_trl(*shlex.split(command)[3:], folder=tmp_path)
    result = read_run(next((tmp_path / "outputs/smoke").glob("*/FTW/seed=0")))
    assert result.source_network == "outputs/source/2/scratch/seed=0/policy.safetensors"


def changed(**cells: str) -> tuple[str, ...]:
    return tuple((dict(zip(COLUMNS, ROW, strict=True)) | cells).values())


@pytest.mark.parametrize(
    "row",
    [
        ROW[:3],
        changed(source="../3"),
        changed(arm="FT3; rm\x1b[2J"),
        changed(profile="endless"),
        changed(epsilon_start="7"),
        changed(gain="inf", high="inf"),
        changed(low="nan"),
        changed(high="0.04"),
    ],
)
def test_a_bad_row_is_refused_in_a_line(row: tuple[str, ...], tmp_path: Path) -> None:
    path = write(tmp_path / "t.csv", ROW, row)
    with pytest.raises(ConfigError, match=r"transfers\.csv") as caught:
        read_transfers(path)
    assert str(path) in str(caught.value) and str(caught.value).isprintable()


def test_no_table_is_refused_in_a_line(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"--measured: .*none.csv cannot be read"):
        read_transfers(tmp_path / "none.csv")
    # Another table without rows must not pass as one without transfers.
    path = tmp_path / "claims.csv"
    path.write_text("claim,verdict\n")
    with pytest.raises(ConfigError, match=r"--measured: .*claims.csv is not a report's transfers.csv"):
        read_transfers(path)


def test_cases_are_matched_by_fingerprint_not_by_name(world: World) -> None:
    cases = [load_case(name, world) for name in ("2", "3", "4")]
    own = {case.name: case.fingerprint for case in cases}

    def known(source: str, target: str, low: float) -> Transfer:
        return Transfer("x", "y", source, target, "quick", "FT3", None, 15, low + 0.1, low, low + 0.2)

    worse, better = known(own["3"], own["4"], 0.1), known(own["2"], own["4"], 0.2)
    irrelevant = [known(*pair, 0.3) for pair in ((own["3"], "x"), ("x", own["4"]), (own["4"], own["4"]))]
    found = transfers_to(cases[2], [worse, *irrelevant, better], cases)
    assert [(one.source, one.target, one.low) for one in found] == [("2", "4", 0.2), ("3", "4", 0.1)]


@pytest.mark.parametrize("name", ODD)
def test_commands_keep_odd_names(name: str) -> None:
    found = Transfer(name, name, "abc", "def", "quick", "FT3", 0.5, 15, 0.05, 0.03, 0.07)
    first, second = map(composed_values, found.commands())
    assert first["target"] == second["source"] == second["target"] == name
    assert second["source_file"] == f"{first['output']}/{name}/scratch/seed=0/policy.safetensors"
