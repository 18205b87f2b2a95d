"""What the docs say was found is what the kept tables of the confirmatory study say."""

import csv
import re
from collections.abc import Iterable

import pytest
import yaml

from ship_trl.cli.ask import answers
from ship_trl.study.analysis.study import Study, read_study
from tests.command import ROOT
from tests.findings import LONG, NUMBER, NUMBERS, PAGES, anew, long_table, section
from tests.study.test_confirmatory import FOLDER, REPORT, SEEN

VERDICTS = ("supported", "contradicted", "equivalent")


@pytest.fixture(scope="module")
def study() -> Study:
    return read_study(FOLDER)


def table(name: str) -> list[dict[str, str]]:
    with (REPORT / name).open(newline="") as file:
        return list(csv.DictReader(file))


def found_in(page: str) -> str:
    return section((ROOT / page).read_text(), page)


@pytest.mark.parametrize("page", PAGES)
def test_every_number_with_a_sign_is_what_the_study_answers(page: str, study: Study) -> None:
    text = found_in(page)
    assert len(text) > 500 and re.search(NUMBERS, text)
    assert anew(text, study) == text
    # None stands by itself, of which nothing is named: whatever is put in its place would be written anew.
    wrong = re.sub(r"\d\.\d\d(?= \|)", "9.99", re.sub(NUMBER, "+9.99", text))
    assert "+9.99" in wrong and "9.99" not in anew(wrong, study)


def test_a_number_that_is_not_the_studys_is_found(study: Study) -> None:
    inline = "`high: FTW above scratch (area)` +9.000 (+9.000\nto +9.000; greedy +9.0)"
    in_a_table = "| | high | low |\n| --- | --- | --- |\n| `FTW (start)` | +9.0 (+9.0 to +9.0) | as said |\n"
    for text in (inline, in_a_table):
        written = anew(text, study)
        assert "9." not in re.sub(r"\.\d+", ".", written) and anew(written, study) == written
        assert re.sub(NUMBER, "", written) == re.sub(NUMBER, "", text)
    alike = "| | conv1 |\n| --- | --- |\n| `high: scratch beside source` | 9.00 |\n"
    assert re.search(r"\| 0\.\d\d \|", anew(alike, study))
    (finding,) = answers(study, ["high: FTW above scratch (area)"], SEEN)
    assert f"{finding.estimate.value:+.3f} (" in anew(inline, study)
    assert f"greedy {finding.beside['greedy area'].value:+.1f}" in anew(inline, study)


def claims(verdict: str) -> list[str]:
    rows = {row["claim"]: row["claim's verdict"] for row in table("claims.csv") if row["claim"][0] in "CH"}
    return [name for name, found in rows.items() if found == verdict]


@pytest.mark.parametrize("page", ["docs/findings.md", "README.md"])
def test_each_claim_has_the_verdict_of_the_report(page: str) -> None:
    text = " ".join(found_in(page).split())
    for verdict in VERDICTS:
        told = re.findall(rf"{verdict.capitalize()}: ([^.]+)\.", text)
        assert told == [", ".join(claims(verdict)) or "none"], verdict
    left = re.findall(r"Open: ([^.]+)\.", text)
    assert left in ([", ".join(claims("inconclusive"))], [f"the other {len(claims('inconclusive'))}"])


def runs_of(part: str) -> list[dict[str, str]]:
    return [row for row in table("runs.csv") if row["part"] == part]


def fallen(rows: Iterable[dict[str, str]]) -> str:
    kept = list(rows)
    return f"{sum(float(row['fell']) for row in kept):.0f} of {len(kept)}"


def test_runs_that_fell_back_are_counted_right() -> None:
    pairs = runs_of("pairs")
    scratch = fallen(row for row in pairs if row["arm"] == "scratch")
    transfers = fallen(row for row in pairs if row["arm"] != "scratch")
    text = " ".join(found_in("docs/findings.md").split())
    assert f"{scratch} runs from scratch, {transfers} transfers of the pairs" in text
    assert f"and {fallen(runs_of('controls'))} controls" in text


def test_contrasts_that_hold_are_counted_right() -> None:
    text = " ".join(found_in("docs/open-claims.md").split())
    told = re.findall(r"\((\d+) of (\d+) (?:contrasts )?of (H\w+)\)", text)
    assert told
    for held, every, claim in told:
        verdicts = [row["verdict"] for row in table("claims.csv") if row["claim"] == claim]
        assert (verdicts.count("supported"), len(verdicts)) == (int(held), int(every)), claim


def test_sources_that_cannot_sail_the_target_are_counted_right() -> None:
    begun = [row for row in runs_of("pairs") if row["arm"] == "FTW" and float(row["start"]) <= 0.05]
    high, low, lowest = (sum(row["pair"] == pair for row in begun) for pair in ("high", "low", "lowest"))
    text = " ".join(found_in("docs/controls.md").split())
    assert f"{high} of {SEEN} in pair high begin at 0.05 or below, {low} in low, {lowest} in lowest" in text


def test_arms_that_are_sooner_are_counted_right(study: Study) -> None:
    arms = [f"{kind}{n}" for kind in ("FE", "FT") for n in (1, 2, 3, 4)] + ["FTW"]
    questions = [
        f"{pair}: {arm} sooner than scratch (time)" for pair in ("high", "low", "lowest") for arm in arms
    ]
    found = answers(study, questions, SEEN)
    sooner = [one.what for one in found if one.estimate.low > 0]
    words = ("none", "one", "two", "three", "four", "five", "six")
    text = " ".join(found_in("docs/open-claims.md").split())
    assert f"Of {len(questions)} arms of the pairs {words[len(sooner)]} " in text
    assert all(f"`{what}`" in text for what in sooner)
    lower, higher = ([one for one in found if one.beside[f"time to {at}"].low > 0] for at in (0.5, 0.8))
    assert f"At 0.5 there are {len(lower)}, at 0.8 there are {len(higher)};" in text
    everywhere = [
        one.what.split()[:2] for one in found if one in lower and one in higher and one.what in sooner
    ]
    assert everywhere == [["high:", "FE4"], ["lowest:", "FE3"]]
    assert "only FE4 of pair high and FE3 of pair lowest are among all three" in text
    short = " ".join(found_in("docs/findings.md").split())
    assert f"is seen in {words[len(sooner)]} of {len(questions)} arms" in short


def test_how_sure_the_closest_claims_are_is_told_right() -> None:
    p = {row["claim"]: float(row["claim's p"]) for row in table("claims.csv") if row["claim's p"]}
    text = " ".join(found_in("docs/findings.md").split())
    assert f"The p of C1 and of H9b are {p['C1']:.3f}," in text and f"{p['H9b']:.3f}" == f"{p['C1']:.3f}"


def test_arms_that_gain_and_lose_are_counted_right(study: Study) -> None:
    """By intervals that hold together, by those of each arm, and by transfer ratios."""
    places = {"high": ("1", "2"), "low": ("3", "4"), "lowest": ("5", "6")}
    arms = [f"{kind}{n}" for kind in ("FE", "FT") for n in (1, 2, 3, 4)] + ["FTW"]
    together = [row for row in table("transfers.csv") if (row["source"], row["target"]) in places.values()]
    alone = answers(study, [f"{pair}: {arm} above scratch (area)" for pair in places for arm in arms], SEEN)
    ratios = {
        (row["pair"], row["arm"]): float(row["transfer ratio"])
        for row in table("arms.csv")
        if row["part"] == "pairs" and row["arm"] in arms
    }
    above = sum(float(row["low"]) > 0 for row in together)
    below = sum(float(row["high"]) < 0 for row in together)
    own = sum(one.estimate.low > 0 for one in alone), sum(one.estimate.high < 0 for one in alone)
    worse = [arm for (_, arm), ratio in ratios.items() if ratio < 0]
    assert len(together) == len(alone) == len(ratios) == 27
    text = " ".join(found_in("docs/controls.md").split())
    assert f"above {above}, below {below}, neither {27 - above - below} " in text
    assert f"each by its own interval, {own[0]}, {own[1]} and {27 - sum(own)}." in text
    assert f"{len(worse)} of 27, two of them finetuned." in text
    assert sum(arm.startswith("FT") for arm in worse) == 2


def test_shares_of_what_could_be_gained_are_told_right(study: Study) -> None:
    gains = yaml.safe_load((ROOT / "conf/analysis.yaml").read_text())["gains"]
    found = answers(study, ["every pair: FE3 above scratch (area)"], SEEN)
    pairs = {"2": "high", "4": "low", "6": "lowest"}
    shares = ", ".join(
        f"{one.estimate.value / gains[case]['area']:.2f} in {pair}"
        for one, (case, pair) in zip(found, pairs.items(), strict=True)
    )
    assert shares in " ".join(found_in("docs/controls.md").split())


def test_what_could_be_gained_is_that_of_the_margins() -> None:
    gains = yaml.safe_load((ROOT / "conf/analysis.yaml").read_text())["gains"]
    told = re.findall(r"\| could be gained: (\w+) \|(.+)\|", found_in("docs/findings.md"))
    assert len(told) == 3
    for metric, cells in told:
        # Targets of the pairs high, low and lowest.
        assert [float(cell) for cell in cells.split("|")] == [gains[case][metric] for case in "246"]


def test_seeds_that_would_decide_are_those_of_the_report() -> None:
    verdicts = (REPORT / "verdicts.md").read_text().splitlines()
    text = found_in("docs/findings.md").partition("- **Seeds**")[2].partition("\n- ")[0]
    told = re.findall(r"([CH]\d\w?)\s(\d+)", text)
    assert told
    for claim, count in told:
        (line,) = (line for line in verdicts if line.startswith(f"| {claim} |"))
        assert f" {count} seeds would tell" in line, claim


def test_the_study_at_the_papers_length_is_told_as_far_as_it_was_run() -> None:
    text = (ROOT / "docs/paper-length.md").read_text()
    assert long_table() in text
    study = read_study(LONG)
    (whole, begun) = re.findall(r"Done are (\d) of (\d) seeds", text)[0]
    seeds = {key[3] for key in study.records}
    assert (len(seeds), len(study.seeds)) == (int(whole), int(begun))
    # A source, scratch and six arms.
    assert len(study.records) == 8 * len(seeds) and not study.broken
