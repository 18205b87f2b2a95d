"""Count what an update, a decision and a step cost: unlike times, counts do not depend on the machine.

Limits are a few per cent above the counts when they were set, so that another version of torch passes.
"""

from collections.abc import Callable
from typing import Any

import pytest
import torch
from tensordict import TensorDict
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils.flop_counter import flop_registry

from benchmarks.ours import Ours, make_ours

COPIES = {"copy_", "_to_copy", "clone", "cat", "index_select", "index", "contiguous", "stack"}


class Counting(TorchDispatchMode):
    """Counts calls that compute or move something, operations, and bytes that are copied or converted."""

    def __init__(self) -> None:
        super().__init__()
        self.calls = self.copied = self.operations = 0

    def __torch_dispatch__(
        self, function: Any, types: Any, args: tuple[Any, ...] = (), kwargs: dict[str, Any] | None = None
    ) -> Any:
        out = function(*args, **(kwargs or {}))
        # Views move nothing.
        if not function.is_view:
            self.calls += 1
        if function.overloadpacket.__name__ in COPIES and isinstance(out, Tensor):
            self.copied += out.numel() * out.element_size()
        # FlopCounterMode knows these too, but cannot enter a module that holds a tensordict.
        if function.overloadpacket in flop_registry:
            self.operations += flop_registry[function.overloadpacket](*args, **(kwargs or {}), out_val=out)
        return out


def counted(action: Callable[[], object]) -> tuple[int, float, float]:
    """Return calls, megabytes copied, and floating point operations of matrix products in millions."""
    # The first call makes what later ones reuse.
    action()
    with Counting() as counting:
        action()
    return counting.calls, counting.copied / 1e6, counting.operations / 1e6


def check_costs(action: Callable[[], object], limits: tuple[float, ...]) -> None:
    costs = counted(action)
    assert all(cost <= limit for cost, limit in zip(costs, limits, strict=True)), costs


def ours(arm: str, precision: str = "bf16") -> Ours:
    made = make_ours(arm, f"learn.precision={precision}")
    made.fill(300)
    return made


# Calls, megabytes, millions of operations.
UPDATE = {
    ("scratch", "bf16"): (158, 15.6, 1000.0),
    ("FE2", "bf16"): (132, 14.2, 720.0),
    ("FE3", "bf16"): (82, 6.6, 177.0),
    ("FE4", "bf16"): (61, 0.08, 11.0),
    ("FE3", "fp32"): (75, 6.1, 177.0),
    ("FE4", "fp32"): (62, 0.08, 11.0),
}


@pytest.mark.parametrize(("arm", "precision"), UPDATE)
def test_an_update(arm: str, precision: str) -> None:
    learner = ours(arm, precision)
    batch = learner.sample()
    check_costs(lambda: learner.algorithm.learn_from(batch), UPDATE[arm, precision])


def act(learner: Ours, observation: Tensor) -> None:
    """Choose greedy actions as exploration does."""
    learner.algorithm.policy.epsilon = 0.0
    key = learner.algorithm.policy.in_keys[0]
    learner.algorithm.policy(TensorDict({key: observation}, [len(observation)]))


def test_a_decision() -> None:
    learner = ours("scratch")
    observation = learner.sample()["state"][:1]
    check_costs(lambda: act(learner, observation), (28, 0.36, 21.5))


@pytest.mark.parametrize(("arm", "limits"), [("scratch", (14, 0.001, 0.0)), ("FE4", (32, 0.06, 12.2))])
def test_a_step_of_the_environment(arm: str, limits: tuple[float, ...]) -> None:
    learner = ours(arm)
    current = learner.env.reset().set("action", torch.tensor([3]))
    check_costs(lambda: learner.env.step_and_maybe_reset(current.clone()), limits)
