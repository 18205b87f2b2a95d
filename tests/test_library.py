"""Code blocks of docs/library.md run: the environment and the loss alone, and a mask of your own."""

import re
import textwrap
from pathlib import Path
from typing import Any

from tests.command import ROOT, SMOKE, ship_trl


def block(heading: str) -> str:
    """Return the first code block below a heading."""
    text = (ROOT / "docs/library.md").read_text().split(f"## {heading}\n")[1]
    (found,) = re.findall(r"\A\n((?:    .*\n|\n(?=    ))+)", text)
    return textwrap.dedent(found)


def test_environment_and_loss_work_alone() -> None:
    values: dict[str, Any] = {}
    exec(block("The environment and the loss alone"), values)
    assert values["steps"].shape == (4, 10)
    slopes = [parameter.grad for parameter in values["loss_module"].parameters() if parameter.requires_grad]
    assert slopes and all(slope is not None and bool(slope.any()) for slope in slopes)


def test_a_network_is_trained_under_a_mask_of_your_own(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(block("Masks").partition("\npython")[0])
    words = "target=2", "method=scratch", "observation=vector", "output=outputs"
    ship_trl(*SMOKE, *words, "mask=mine.py:make", folder=tmp_path)
    refused = ship_trl("outputs/2", folder=tmp_path, verb="evaluate", code=1).stderr
    assert refused.startswith("ship_trl: policy: outputs/2/")
    assert "under the mask mine.py:make, whose code runs if you name it; allowed: " in refused
    ship_trl("outputs/2+mine.py:make", "--csv", "found.csv", folder=tmp_path, verb="evaluate")
    assert "+mine.py:make" in (tmp_path / "found.csv").read_text()
    other = ship_trl(*SMOKE, *words, "mask=mine.py:other", folder=tmp_path, code=1).stderr
    assert other.count("\n") == 1
    other = ship_trl(*SMOKE, *words, "mask=mine.py:other", "output=o", folder=tmp_path, code=1).stderr
    assert other == "ship_trl: mask: mine.py has no function other\n"
