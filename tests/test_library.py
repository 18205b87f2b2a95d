"""The code blocks of docs/library.md that use TorchRL's parts run."""

import re
import textwrap
from typing import Any

import torch

from tests.command import ROOT


def block(heading: str) -> str:
    """Return the first code block below a heading."""
    text = (ROOT / "docs/library.md").read_text().split(f"## {heading}\n")[1]
    (found,) = re.findall(r"\A\n((?:    .*\n|\n(?=    ))+)", text)
    return textwrap.dedent(found)


def test_the_loop_of_stock_parts_runs_and_learns() -> None:
    code = block("Training with TorchRL's own parts")
    assert code.count("20_000") == 1
    values: dict[str, Any] = {}
    torch.manual_seed(0)
    before, _, rest = code.replace("20_000", "120").partition("for steps in collector:")
    exec(before, values)
    untrained = [parameter.clone() for parameter in values["network"].parameters()]
    exec(f"for steps in collector:{rest}", values)
    assert len(values["replay"]) == 120
    trained = values["network"].parameters()
    assert all(not bool((a == b).all()) for a, b in zip(untrained, trained, strict=True))


def test_environment_and_loss_work_alone() -> None:
    values: dict[str, Any] = {}
    exec(block("The environment and the loss alone"), values)
    assert values["steps"].shape == (4, 10)
    slopes = [parameter.grad for parameter in values["loss_module"].parameters() if parameter.requires_grad]
    assert slopes and all(slope is not None and bool(slope.any()) for slope in slopes)
