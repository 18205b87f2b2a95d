"""The command that says how often the rules err, and that they err as seldom as they allow."""

import pytest

from ship_trl.study.calibration import REPEATS, TRIED, calibrate, main


def test_the_rules_err_about_as_often_as_they_allow() -> None:
    for row in calibrate(repeats=150):
        if row.allowed is None:
            # A difference of another kind: a plain mean's test would see it in a third of the studies.
            assert row.shares[15] < 0.25, row
            continue
        # Of 150, one in twenty is 7.5 with a deviation of 2.7. Of five seeds the test is known to err more.
        most = row.allowed + 3 * (row.allowed * (1 - row.allowed) / 150) ** 0.5
        assert row.shares[15] <= most and row.shares[10] <= most + 0.03, row


def test_the_table_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    main(["--repeats", "2"])
    printed = capsys.readouterr().out
    assert "15 seeds" in printed and "2 simulations each" in printed and REPEATS >= 1000
    assert printed.count("%") > 3 * len(TRIED)


def test_no_simulation_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--repeats", "0"])
    assert ended.value.code == 1 and "--repeats: must be at least 1" in capsys.readouterr().err
