"""What docs/library.md says of TorchRL's parts is so, and its loop runs."""

import re
import textwrap
from typing import Any

import pytest
import torch
from tensordict.nn import TensorDictSequential
from torchrl.envs import ToTensorImage, TransformedEnv
from torchrl.modules import EGreedyModule, QValueActor

from ship_trl.config.types import World
from ship_trl.sim.cases import load_case
from ship_trl.sim.env import ShipEnv
from tests.command import ROOT


def block(heading: str) -> str:
    """The first block of code below a heading."""
    text = (ROOT / "docs/library.md").read_text().split(f"## {heading}\n")[1]
    (found,) = re.findall(r"\A\n((?:    .*\n|\n(?=    ))+)", text)
    return textwrap.dedent(found)


def test_the_loop_of_stock_parts_runs_and_learns() -> None:
    code = block("Training with TorchRL's own parts")
    assert code.count("frames = load_world(), 20_000") == 1
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


def ships(world: World, *, colour: bool = False) -> ShipEnv:
    return ShipEnv(load_case("2", world), world, num_envs=4, from_pixels=True, colour=colour)


@pytest.mark.parametrize("colour", [False, True])
def test_pixels_are_channels_first_already(world: World, colour: bool) -> None:
    channels = 3 if colour else 1
    for tolerant, shape in ((True, (4, channels, 84, 84)), (False, (4, 84, channels, 84))):
        image = ToTensorImage(in_keys=["pixels"], shape_tolerant=tolerant)
        assert TransformedEnv(ships(world, colour=colour), image).reset()["pixels"].shape == shape


def test_the_action_spec_has_the_batch_in_it(world: World) -> None:
    env = ships(world)
    network = lambda pixels: pixels.flatten(1)[:, :7].float()  # noqa: E731
    for spec, right in ((env.action_spec_unbatched, True), (env.action_spec, False)):
        actor = QValueActor(network, in_keys=["pixels"], spec=spec)
        act = TensorDictSequential(actor, EGreedyModule(spec))
        if right:
            assert act(env.reset())["action"].shape == (4,)
        else:
            with pytest.raises(RuntimeError, match="does not match expected shape"):
                act(env.reset())
