"""The command that says how often the rules err, and that they err about as seldom as they allow."""

import pytest

from ship_trl.study.calibration import REPEATS, TRIED, Wrong, calibrate, main

# Of cheap rows many simulations, of the others as many as a test may take.
MANY, SOME, FEW = 1500, 400, 100
# How many times what is allowed a row may err. Arms with a tail, or whose seeds vary in different ways, are
# known to err a little more than is allowed on both sides together, and so twice as often on one of them.
TOLERATED = {
    "one with a long tail: said to be better": 2.6,
    "spreads alike: whole curves said to vary less": 3,
}


@pytest.mark.parametrize(("what", "allowed", "wrong"), TRIED, ids=[what for what, _, _ in TRIED])
def test_the_rules_err_about_as_often_as_they_allow(what: str, allowed: float | None, wrong: Wrong) -> None:
    dear = what.startswith(("a figure", "the same, ", "spreads"))
    repeats = SOME if dear and what in TOLERATED else FEW if dear else MANY
    (row,) = calibrate(repeats, [(what, allowed, wrong)])
    if allowed is None:
        # A difference of another kind: Student's t of the mean sees it in a quarter of the studies.
        assert row.shares[15] < 0.15
        return
    chance = 3 * (allowed * (1 - allowed) / repeats) ** 0.5
    assert max(row.shares.values()) <= TOLERATED.get(what, 1.3) * allowed + chance


def test_the_table_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    main(["--repeats", "2"])
    printed = capsys.readouterr().out
    assert "15 seeds" in printed and "2 simulations each" in printed and REPEATS >= 1000
    assert printed.count("%") > 3 * len(TRIED)


def test_no_simulation_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--repeats", "0"])
    assert ended.value.code == 1 and "--repeats: must be at least 1" in capsys.readouterr().err
