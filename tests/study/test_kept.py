"""The quick study that is kept with the project: what the README says of it is what its report says."""

import re
from pathlib import Path

from tests.test_cli import ROOT

REPORT = ROOT / "outputs/quick_study/report"
README = (ROOT / "README.md").read_text()


def test_the_readme_has_its_verdicts_and_figures() -> None:
    assert (REPORT / "verdicts.md").read_text() in README
    pictures = re.findall(r"\]\((outputs/quick_study/report/[a-z_]+\.png)\)", README)
    assert {Path(path).stem for path in pictures} == {
        "pair_high",
        "pair_low",
        "pair_lowest",
        "reuse",
        "gains",
    }
    assert all((ROOT / path).stat().st_size > 20_000 for path in pictures)
