"""Networks with other layers than the paper's, and their outputs by stock convolutions."""

import torch
import torch.nn.functional as F
from torch import Generator, Tensor

from ship_trl.config.network import load_network
from ship_trl.config.types import Network
from ship_trl.learn.network import DuelingNetwork

NETWORKS = {
    "paper": load_network(),
    "five": load_network("five"),
    # The first kernel is three words wide, and the last two layers are linear.
    "wide": Network([[8, 12, 4], [16, 4, 2], [12, 8, 1], [10, 1, 1]], 14),
    # Windows of the first layer overlap by more than half: no space-to-depth.
    "overlap": Network([[6, 16, 4], [8, 18, 1]], 10),
}
# Networks that the incremental backend does not support.
ODD = {
    "odd": Network([[6, 7, 3], [8, 5, 2], [10, 11, 1]], 9),
    "halves": Network([[6, 6, 3], [8, 4, 2], [10, 12, 1]], 9),
    "single": Network([[5, 84, 4]], 8),
}


def network(name: str = "paper", channels: int = 1, frozen: int = 0, seed: int = 0) -> DuelingNetwork:
    """Return a network with random biases, because zeros would hide mistakes."""
    generator = Generator().manual_seed(seed)
    made = DuelingNetwork(channels, 7, generator, (NETWORKS | ODD)[name])
    with torch.no_grad():
        for parameter in made.parameters():
            if parameter.dim() == 1:
                parameter.uniform_(-0.3, 0.3, generator=generator)
    made.freeze(frozen)
    return made


def plain_forward(net: DuelingNetwork, pixels: Tensor) -> Tensor:
    """Compute figure 3 layer by layer, with stock convolutions."""
    x = pixels.float() / 255
    for conv in net.layers:
        x = F.relu(conv(x))
    x = F.relu(net.shared(x.flatten(1)))
    advantage = net.advantage(x)
    return net.value(x) + advantage - advantage.mean(1, keepdim=True)
