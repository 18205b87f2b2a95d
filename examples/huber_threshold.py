"""Draw why a small Huber threshold lets a policy fall back into colliding.

    python examples/huber_threshold.py outputs/huber_threshold.png

States that look alike share a value. If a share p of them ends in a collision (-20 in scaled rewards) and
the others in nothing, their value should be -20 p. Huber's loss with a threshold pulls each error with at
most that strength, so that it settles elsewhere: with threshold 1 at about -p / (1 - p). This fits one
value by the learner's own loss for several thresholds and draws where it settles.
"""

import sys
from pathlib import Path

import numpy as np
import torch
from matplotlib.figure import Figure

from ship_trl.config.types import Loss
from ship_trl.learn.q_learning import td_loss

COLLISION = -20.0
SHARES = np.linspace(0.01, 0.5, 25)
# Okabe and Ito's colours, and the threshold that each stands for.
THRESHOLDS = {1.0: "#D55E00", 10.0: "#0072B2", 20.0: "#000000"}


def settled(threshold: float, share: float, samples: int = 1000) -> float:
    """Return the value at which the loss of `samples` outcomes is least: where its slope changes sign."""
    td_target = torch.zeros(samples, 1)
    td_target[: round(share * samples)] = COLLISION
    low, high = COLLISION, 0.0
    for _ in range(40):
        value = torch.full((samples, 1), (low + high) / 2, requires_grad=True)
        td_loss(value, td_target, Loss["huber"], threshold).backward()
        assert value.grad is not None
        low, high = ((low + high) / 2, high) if float(value.grad.sum()) < 0 else (low, (low + high) / 2)
    return (low + high) / 2


def main(path: Path) -> None:
    """Draw the picture."""
    figure = Figure(figsize=(6.4, 4), dpi=110, layout="constrained")
    axes = figure.subplots()
    for threshold, colour in THRESHOLDS.items():
        values = [settled(threshold, share) for share in SHARES]
        name = f"threshold {threshold:.0f}" + (" (as the square)" if threshold == -COLLISION else "")
        axes.plot(SHARES, values, color=colour, label=name, linestyle="--" if threshold == 10 else "-")
    axes.set_xlabel("share of the states that end in a collision")
    axes.set_ylabel("value that is learned, scaled rewards")
    axes.set_title("What a collision costs, as the learner sees it")
    axes.grid(alpha=0.3)
    axes.legend()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "huber_threshold.png"))
