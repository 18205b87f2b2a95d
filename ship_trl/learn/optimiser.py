"""Adam for weights in channels-last memory format."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import torch
from torch import Tensor, nn

from ship_trl.learn.network import DuelingNetwork


class ChannelsLastAdam(torch.optim.Optimizer):
    """Adam (Kingma and Ba, 2015) that updates float32 channels-last filters without copying them.

    torch's own fused step copies tensors that are not contiguous, which more than doubles the time for
    conv4. Kernel, results and state names are the same as in `torch.optim.Adam(fused=True)`.
    """

    def __init__(self, params: Iterable[Tensor] | Iterable[dict[str, Any]], lr: float) -> None:
        super().__init__(params, {"lr": lr, "betas": (0.9, 0.999), "eps": 1e-8, "factor": 1.0})
        device = self.param_groups[0]["params"][0].device
        if device.type == "cuda":
            # A CUDA graph would keep a Python number. Groups that are added later share the tensor.
            self.defaults["lr"] = torch.tensor(lr, device=device)
            for group in self.param_groups:
                group["lr"] = self.defaults["lr"].clone()
        self.set_lr(lr)

    @torch.no_grad()
    def set_lr(self, lr: float) -> None:
        """Set the learning rate, which each group multiplies by its `factor`."""
        for group in self.param_groups:
            own = lr * group["factor"]
            group["lr"] = group["lr"].fill_(own) if isinstance(group["lr"], Tensor) else own

    @torch.no_grad()
    def step(self) -> None:  # type: ignore[override]
        """Update all parameters that have a gradient."""
        for group in self.param_groups:
            learning = [parameter for parameter in group["params"] if parameter.grad is not None]
            if not learning:
                continue
            states = [self.state[parameter] or self.init_state(parameter) for parameter in learning]
            steps = [state["step"] for state in states]
            torch._foreach_add_(steps, 1.0)
            rows = (
                [in_memory_order(one, p) for one in (p, p.grad, state["exp_avg"], state["exp_avg_sq"])]
                for p, state in zip(learning, states, strict=True)
            )
            fused_adam: Any = torch._fused_adam_
            fused_adam(
                *map(list, zip(*rows, strict=True)),
                [],
                steps,
                lr=group["lr"],
                beta1=group["betas"][0],
                beta2=group["betas"][1],
                weight_decay=0.0,
                eps=group["eps"],
                amsgrad=False,
                maximize=False,
            )

    def init_state(self, parameter: Tensor) -> dict[str, Tensor]:
        """Initialise the state of a parameter before its first step, and return it."""
        self.state[parameter] = {
            "step": torch.zeros((), device=parameter.device),
            "exp_avg": torch.zeros_like(parameter),
            "exp_avg_sq": torch.zeros_like(parameter),
        }
        return self.state[parameter]

    def add_thawed(self, network: nn.Module) -> None:
        """Add the parameters of a network that learn now and did not before."""
        known = {id(parameter) for group in self.param_groups for parameter in group["params"]}
        if thawed := [p for p in learning_parameters(network) if id(p) not in known]:
            self.add_param_group({"params": thawed})

    def averages(self, network: nn.Module) -> dict[str, Tensor]:
        """Return the state of each parameter of a network by dotted names, without copying it."""
        return {
            f"{name}.{key}": value
            for name, parameter in network.named_parameters()
            for key, value in self.state.get(parameter, {}).items()
        }

    @torch.no_grad()
    def load_averages(self, network: nn.Module, averages: Mapping[str, Tensor]) -> None:
        """Load what `averages` returned."""
        for name, parameter in network.named_parameters():
            if f"{name}.step" in averages:
                for key, value in self.init_state(parameter).items():
                    value.copy_(averages[f"{name}.{key}"])


def learning_groups(network: DuelingNetwork, factor: Callable[[str], float]) -> list[dict[str, Any]]:
    """Return the parameters that learn, in a group for each factor of the learning rate, by layer names."""
    groups: dict[float, list[nn.Parameter]] = {}
    for name in network.all_layers:
        if learning := learning_parameters(getattr(network, name)):
            groups.setdefault(factor(name), []).extend(learning)
    return [{"params": params, "factor": factor} for factor, params in groups.items()]


def learning_parameters(network: nn.Module) -> list[nn.Parameter]:
    """Return the parameters that learn."""
    return [parameter for parameter in network.parameters() if parameter.requires_grad]


def in_memory_order(tensor: Tensor, parameter: Tensor) -> Tensor:
    """Return a tensor contiguously in the memory order of a parameter; a view where possible."""
    if parameter.is_contiguous():
        return tensor.contiguous()
    # Filters are channels last, alone or stacked: the kernel would update a copy of them.
    order = sorted(range(parameter.dim()), key=parameter.stride, reverse=True)
    return tensor.permute(order).contiguous()
