"""What transfers gained, as a table that may be a stranger's."""

from pathlib import Path

import pytest

from ship_trl.config import ConfigError, World
from ship_trl.sim.cases import load_case
from ship_trl.transfer.measured import COLUMNS, Transfer, read_transfers, transfers_to

ROW = ("3", "4", "abc", "def", "FT3", "", "15", "0.05", "0.03", "0.07")


def write(path: Path, *rows: tuple[str, ...]) -> Path:
    path.write_text("".join(",".join(row) + "\n" for row in (COLUMNS, *rows)))
    return path


def test_a_row_is_a_transfer_and_the_command_that_does_it(tmp_path: Path) -> None:
    low = ("2", "new", "abc", "def", "FTW", "0.1", "1", "0.05", "nan", "nan")
    usual, started = read_transfers(write(tmp_path / "t.csv", ROW, low))
    assert (usual.gain, usual.seeds, usual.epsilon_start, usual.sure) == (0.05, 15, None, True)
    assert usual.line == "python -m ship_trl source=3 target=4 +arm=FT3"
    assert started.line == "python -m ship_trl source=2 target=new +arm=FTW learn.epsilon_start=0.1"
    assert not started.sure


@pytest.mark.parametrize(
    "row",
    [
        ("3", "4", "abc"),
        ("../3", "4", "abc", "def", "FT3", "", "15", "0.05", "0.03", "0.07"),
        ("3", "4", "abc", "def", "FT3; rm\x1b[2J", "", "15", "0.05", "0.03", "0.07"),
        ("3", "4", "abc", "def", "FT3", "7", "15", "0.05", "0.03", "0.07"),
        ("3", "4", "abc", "def", "FT3", "", "0", "0.05", "0.03", "0.07"),
        ("3", "4", "abc", "def", "FT3", "", "15", "inf", "0.03", "0.07"),
        ("3", "4", "abc", "def", "FT3", "", "15", "much", "0.03", "0.07"),
    ],
)
def test_a_bad_row_is_refused_in_a_line(row: tuple[str, ...], tmp_path: Path) -> None:
    path = write(tmp_path / "t.csv", ROW, row)
    with pytest.raises(ConfigError, match=r"transfers\.csv") as caught:
        read_transfers(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_no_table_is_refused_in_a_line(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"--measured: .*none.csv cannot be read"):
        read_transfers(tmp_path / "none.csv")
    # Without a row it would else be a table in which no transfer was measured.
    path = tmp_path / "claims.csv"
    path.write_text("claim,verdict\n")
    with pytest.raises(ConfigError, match=r"--measured: .*claims.csv is not a report's transfers.csv"):
        read_transfers(path)


def test_a_case_is_known_by_what_it_is_and_not_by_its_name(world: World) -> None:
    case = load_case("4", world)

    def to(fingerprint: str, gain: float, source: str = "abc") -> Transfer:
        return Transfer("3", "4", source, fingerprint, "FT3", None, 15, gain, gain - 0.1, gain + 0.1)

    worse, better, other = to(case.fingerprint, 0.1), to(case.fingerprint, 0.2), to("another", 0.3)
    itself = to(case.fingerprint, 0.4, source=case.fingerprint)
    assert transfers_to(case, [worse, other, itself, better]) == [better, worse]
