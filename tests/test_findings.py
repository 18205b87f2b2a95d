"""What the docs say was found is what the kept tables of the confirmatory study say."""

import csv
import re
from collections import defaultdict

import pytest

from ship_trl.study.analysis.contrasts import Claimed
from tests.test_cli import ROOT

REPORT = ROOT / "outputs/confirmatory/report"
NUMBER = r"([+-]\d+\.\d+)"
# A contrast of claims.csv: `high: FE3 above scratch (area)` +0.12 (+0.09 to +0.15; greedy +0.20).
CONTRAST = rf"`([^`]+)` {NUMBER} \({NUMBER} to {NUMBER}(?:; greedy {NUMBER})?\)"
# A row of transfers.csv: case 3 to case 4, FT3: +0.12 (+0.09 to +0.15).
GAIN = rf"case (\w+) to case (\w+), (\w+): {NUMBER} \({NUMBER} to {NUMBER}\)"


def table(name: str) -> list[dict[str, str]]:
    with (REPORT / name).open(newline="") as file:
        return list(csv.DictReader(file))


def found_in(page: str) -> str:
    """What a page says was found, each paragraph on a line of its own."""
    text = (ROOT / page).read_text()
    if page == "README.md":
        text = text.partition("## What was found\n")[2].partition("\n## ")[0]
    return re.sub(r"(?<!\n)\n(?![\n|-]) *", " ", text)


def as_written(words: tuple[str, ...], row: dict[str, str], ends: tuple[str, ...]) -> bool:
    return all(
        f"{float(row[end]):+.{len(word.partition('.')[2])}f}" == word
        for word, end in zip(words, ends, strict=True)
    )


def leans(row: dict[str, str]) -> bool:
    """Whether a contrast is estimated as it is claimed, however unsure."""
    bound = float(row["margin"] or 0) if row["claimed"] == Claimed.no_more else 0.0
    value = float(row["estimate"])
    return value <= bound if row["claimed"] == Claimed.no_more else value > bound


def test_the_table_of_verdicts_is_that_of_the_report() -> None:
    contrasts = defaultdict(list)
    for row in table("claims.csv"):
        contrasts[row["claim"]].append(row)
    lines = []
    for name, rows in contrasts.items():
        sentence, verdict, after = (
            rows[0][key] for key in ("sentence", "claim's verdict", "decided after seeds")
        )
        told = f"{verdict}, after {after} seeds" if after else verdict
        leaning = f"{sum(map(leans, rows))} of {len(rows)}"
        if name[0] in "CH":
            lines.append(f"| {name} | {sentence.replace('<', '&lt;')} | {leaning} | {told} |")
    page = (ROOT / "docs/findings.md").read_text().splitlines()
    assert [line for line in page if re.match(r"\| [CH]\d", line)] == lines


@pytest.mark.parametrize("page", ["README.md", "docs/findings.md"])
def test_every_number_with_a_sign_is_of_a_contrast_that_is_named(page: str) -> None:
    text = found_in(page)
    assert len(text) > 500
    # Of two claims, which may have been decided at different looks.
    contrasts = defaultdict(list)
    for row in table("claims.csv"):
        contrasts[row["contrast"]].append(row)
    ends = "estimate", "estimate low", "estimate high"
    for what, *words, greedy in re.findall(CONTRAST, text):
        rows = [row for row in contrasts[what] if as_written(tuple(words), row, ends)]
        assert rows, what
        assert not greedy or f"greedy area {greedy}" in rows[0]["beside"].split("; "), what
    gains = {(row["source"], row["target"], row["arm"]): row for row in table("transfers.csv")}
    for source, target, arm, *words in re.findall(GAIN, text):
        assert as_written(tuple(words), gains[source, target, arm], ("gain", "low", "high")), (source, target)
    left = re.sub(GAIN, "", re.sub(CONTRAST, "", text))
    assert not re.findall(NUMBER, left)
