"""The code block of docs/library.md that uses the environment and the loss alone runs."""

import re
import textwrap
from typing import Any

from tests.command import ROOT


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
