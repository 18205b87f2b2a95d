"""What a training is made of, as it is before the first step: environments, networks, replay, generators."""

from __future__ import annotations

import copy
import hashlib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import torch
from torch import Generator

from ship_trl.config.types import Method, SourceWeights
from ship_trl.learn.agent import Agent
from ship_trl.learn.jumpstart import jumpstart
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.policy import greedy_policy
from ship_trl.learn.rollout import Episode, rollout
from ship_trl.learn.train import Training
from ship_trl.policies.pretrained import PRETRAINED
from ship_trl.run.demonstrate import show_demonstrations
from ship_trl.run.history import History
from ship_trl.run.plan import Run
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.render import Rasteriser
from ship_trl.transfer.casebase import Entry
from ship_trl.transfer.layers import Transfer, apply, load_weights, permuted

# Networks that run side by side before training; each takes 3 MB.
JUMPSTART_BATCH = 25


@dataclass(frozen=True)
class Parts:
    """A training that has not begun, and what was measured before it.

    `history` will take what the training gives. `scratch` is the greedy episode of the network before
    anything is copied, `draws` are greedy returns over draws of what is not copied, `origin` says where the
    copied weights came from, None from scratch.
    """

    training: Training
    agent: Agent
    eval_env: ShipEnv
    draw: Rasteriser
    history: History
    scratch: Episode
    draws: list[float]
    origin: str | None

    @property
    def computed(self) -> str:
        """Say by what arithmetic it learns: precision, backend, processor or device, torch, rounding."""
        agent, device = self.agent, self.eval_env.device
        precision = str(agent.dtype).removeprefix("torch.")
        place = torch.backends.cpu.get_cpu_capability() if device.type == "cpu" else device.type
        rounding = probe(agent.dtype, device)
        return f"{precision} {agent.backend.name} {place} torch-{torch.__version__} {rounding}"

    def sail(self, network: DuelingNetwork) -> Episode:
        """Sail the greedy episode of a network."""
        return rollout(self.eval_env, greedy_policy(network, self.draw))[0]


@cache
def probe(dtype: torch.dtype, device: torch.device) -> str:
    """Digest a few products: processors of one name round differently, and their libraries can be told to."""
    generator, digest = Generator().manual_seed(0), hashlib.sha256()
    # Rows, inner and outer size: of a batch's fully connected layer, of conv layers' windows, and of a step.
    for rows, inner, outer in ((32, 3136, 512), (2000, 256, 32), (500, 576, 64), (1, 3136, 512)):
        left, right = (torch.randn(size, generator=generator) for size in ((rows, inner), (inner, outer)))
        for kind in (dtype, torch.float32):
            product = left.to(device, kind) @ right.to(device, kind)
            digest.update(product.float().cpu().numpy().tobytes())
    return digest.hexdigest()[:8]


def make_parts(run: Run, device: torch.device, source: Entry | None) -> Parts:
    """Make them of a run's configuration and its streams of random numbers.

    Raises:
        ConfigError: the source's weights cannot be used, or a demonstration does not end as it says.
    """
    config, learn = run.config, run.config.learn
    # Weights are drawn on the CPU, so that they are the same for every device; the other draws are
    # made where they are used, as torch demands.
    places = {"weights": torch.device("cpu"), "exploration": device, "replay": device}
    streams = {name: Generator(device=at).manual_seed(run.stream(name)) for name, at in places.items()}
    draw = Rasteriser(run.target, config.world, colour=config.colour, device=device)
    eval_env = ShipEnv(run.target, config.world, 1, colour=config.colour, device=device)
    actions = len(config.world.actions)
    network = DuelingNetwork(draw.channels, actions, streams["weights"], config.network)
    transfer = find_transfer(run, network, source)
    network.to(device)
    scratch = rollout(eval_env, greedy_policy(network, draw))[0]
    if transfer:
        apply(network, transfer)
    agent = Agent(network, draw, actions, learn, streams["exploration"])
    encoders = {agent.observation: agent.encode} if agent.observation != "state" else {}
    env = ShipEnv(
        run.target, config.world, learn.num_envs, colour=config.colour, encoders=encoders, device=device
    )
    replay = agent.replay(learn, streams["replay"], device)
    show_demonstrations(run, env, replay)
    kept = DuelingNetwork(draw.channels, actions, Generator(), config.network).to(device)
    return Parts(
        history=History(kept),
        training=Training(env, eval_env, agent, replay, learn),
        agent=agent,
        eval_env=eval_env,
        draw=draw,
        scratch=scratch,
        draws=find_draws(run, agent, eval_env),
        origin=None if transfer is None else origin(run, source),
    )


def find_transfer(run: Run, network: DuelingNetwork, source: Entry | None) -> Transfer | None:
    """Read the source's weights as the run's method asks, or None for scratch."""
    config = run.config
    if config.method is Method.scratch:
        return None
    if config.source_weights is SourceWeights.random:
        # A network like the target's before it learns, drawn from a stream of its own.
        drawn = copy.deepcopy(network)
        drawn.reset(Generator().manual_seed(run.stream("random source")))
        return Transfer(drawn.state_dict(), config.layers, config.method is Method.feature_extraction)
    path, key = source_weights(run, source)
    weights = load_weights(path, network, key)
    if config.source_weights is SourceWeights.permuted:
        weights = permuted(weights, Generator().manual_seed(run.stream("permuted source")))
    return Transfer(weights, config.layers, config.method is Method.feature_extraction)


def source_weights(run: Run, source: Entry | None) -> tuple[Path, str]:
    """Find the file of the source network, and the key that a complaint about it names."""
    if run.pretrained:
        return run.pretrained.file, "source"
    if source:
        return source.policy, "case_base"
    return Path(str(run.config.source_file)), "source_file"


def origin(run: Run, source: Entry | None) -> str:
    """Say where the weights of a transfer came from."""
    if run.config.source_weights is SourceWeights.random:
        return "random"
    if run.pretrained:
        return f"{PRETRAINED}:{run.pretrained.case}"
    return str(source.policy if source else run.config.source_file)


def find_draws(run: Run, agent: Agent, eval_env: ShipEnv) -> list[float]:
    """Greedy returns before training over many draws of what is not copied; one where all is."""
    config = run.config
    count, layers = config.learn.jumpstart_draws, config.layers or 0
    if count == 0:
        return []
    if layers == "all":
        return [rollout(eval_env, agent.greedy)[0].episode_return]
    env = ShipEnv(
        run.target,
        config.world,
        min(count, JUMPSTART_BATCH),
        colour=config.colour,
        device=str(eval_env.device),
    )
    generator = Generator().manual_seed(run.stream("jumpstart"))
    return jumpstart(env, agent.draw, agent.network, layers, count, generator)
