"""Set a run up: environments, networks, replay, the source network, random generators."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import torch
from torch import Generator

from ship_trl.config.arm import SourceWeights, forms
from ship_trl.config.errors import ConfigError
from ship_trl.config.types import Config, Learn
from ship_trl.fast.worlds import accelerator, make_env, make_starts
from ship_trl.files.curve import Row
from ship_trl.learn.algorithm import Algorithm, Setup, Teacher, build_algorithm
from ship_trl.learn.masks import ACTION_MASK, Mask
from ship_trl.learn.network import Draw, DuelingNetwork, make_backend, make_network
from ship_trl.learn.rollout import Episode, greedy_policy, jumpstart, mean_return, rollout
from ship_trl.learn.train import Training
from ship_trl.policies.named import load_network
from ship_trl.policies.pretrained import PRETRAINED, REWARD_SCALE
from ship_trl.run import console
from ship_trl.run.history import History
from ship_trl.run.plan import TEACHER, Run, TeacherFile, find_teacher
from ship_trl.sim.cases import Suite
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.state import mirrored_state
from ship_trl.transfer.casebase import StoredNetwork
from ship_trl.transfer.methods import make_method
from ship_trl.transfer.methods.base import Origin, fixed_copy
from ship_trl.transfer.weights import Weights, load_weights, permute_values, read_look

# Networks that run side by side before training; each takes 3 MB.
JUMPSTART_BATCH = 25
# Allowed difference of a demonstration's return, because processors round differently.
RETURN_TOLERANCE = 0.01


@dataclass(frozen=True)
class Parts:
    """The parts of a training that has not started, and what was measured before it.

    `eval_env` begins each greedy evaluation alike, `starts` draws how training episodes begin. `untrained`
    are greedy episodes of the network before anything is copied, `draws` are greedy returns over random draws
    of the layers that are not copied. `origin` names the copied weights; None from scratch. `teacher` names a
    teacher and the digest of its file. `source_check` measures returns on the source; None without one that
    can be measured. `fast` tells whether loops are compiled.
    """

    training: Training
    algorithm: Algorithm
    eval_env: ShipEnv
    starts: Generator
    history: History
    untrained: list[Episode]
    draws: list[float]
    origin: str | None
    teacher: str | None
    source_check: SourceCheck | None
    fast: bool

    @property
    def computed(self) -> str:
        """Arithmetic: precision, backend, processor or device, torch version, digest of its rounding."""
        algorithm, device = self.algorithm, self.eval_env.device
        precision = str(algorithm.dtype).removeprefix("torch.")
        place = torch.backends.cpu.get_cpu_capability() if device.type == "cpu" else device.type
        place += " uncompiled" if device.type == "cpu" and not self.fast else ""
        rounding = digest_rounding(algorithm.dtype, device)
        return f"{precision} {algorithm.backend} {place} torch-{torch.__version__} {rounding}"

    def evaluate(self, network: DuelingNetwork) -> list[Episode]:
        """Roll out the greedy episodes of a network."""
        return rollout(self.eval_env, greedy_policy(network, self.algorithm.draw, self.algorithm.mask))


@cache
def digest_rounding(dtype: torch.dtype, device: torch.device) -> str:
    """Return a digest of a few matrix products, because processors of the same name may round differently."""
    generator, digest = Generator().manual_seed(0), hashlib.sha256()
    # Rows, inner and outer size: a batch in the fully connected layer, conv windows, and a single step.
    for rows, inner, outer in ((32, 3136, 512), (2000, 256, 32), (500, 576, 64), (1, 3136, 512)):
        left, right = (torch.randn(size, generator=generator) for size in ((rows, inner), (inner, outer)))
        for kind in (dtype, torch.float32):
            product = left.to(device, kind) @ right.to(device, kind)
            digest.update(product.float().cpu().numpy().tobytes())
    return digest.hexdigest()[:8]


def make_parts(run: Run, device: torch.device, source: Source | None) -> Parts:
    """Make the parts of a training from a run's configuration and its random streams.

    Raises:
        ConfigError: a demonstration does not reach the return in its file, or `algorithm.teacher` is invalid.
    """
    config, world, learn = run.config, run.config.world, run.config.learn
    # Weights are drawn on the CPU, so that they are the same on every device. The other streams must be on
    # the device that uses them, as torch demands.
    devices = {"weights": torch.device("cpu"), "exploration": device, "replay": device}
    streams = {name: Generator(device=at).manual_seed(run.stream(name)) for name, at in devices.items()}
    drawn, starts = (Generator().manual_seed(run.stream(name)) for name in ("evaluation", "starts"))
    begun = make_starts(run.target, world).balanced(run.evaluation_episodes, drawn)
    eval_env = make_run_env(run, run.target, device, starts=begun)
    draw, actions = eval_env.observer(config.network), len(world.actions)
    network = make_network(config.network, actions, streams["weights"], colour=config.colour).to(device)
    network.mask, mask = config.mask, make_mask(config)
    untrained = rollout(eval_env, greedy_policy(network, draw, mask))
    method = make_method(run.arm, config.transfer)
    if source is not None:
        if forms()[run.arm.method].uses_function:
            fixed = fixed_copy(network, source.weights)
            method.attach(make_origin(run, fixed, eval_env, mean_return(untrained), mask))
        method.copy(network, source.weights)
    teacher = find_teacher(config)
    looks = [config.network] + ([read_look(teacher.path, TEACHER).network] if teacher else [])
    setup = Setup(
        network=network,
        draw=draw,
        num_actions=actions,
        learn=learn,
        exploration=streams["exploration"],
        replay=streams["replay"],
        method=method,
        options=config.algorithm,
        teacher=read_teacher(teacher, eval_env, config) if teacher else None,
        # The rules are not symmetric: a mirror image would have other encounters.
        mirror=None if any(look.encounters for look in looks) else mirrored_state,
        accelerator=accelerator(config.fast),
        mask=mask,
    )
    algorithm = build_algorithm(setup)
    given: dict[str, Any] = {"encoders": algorithm.encoders, "generator": starts, "margin": config.margin}
    env = make_run_env(run, run.target, device, num_envs=learn.num_envs, **given)
    show_demonstrations(run, env, algorithm)
    return Parts(
        history=History(fixed_copy(network, network.state_dict())),
        training=Training(env, eval_env, algorithm, learn),
        algorithm=algorithm,
        eval_env=eval_env,
        starts=starts,
        untrained=untrained,
        draws=measure_jumpstart(run, algorithm, eval_env),
        origin=None if source is None else source.origin,
        teacher=teacher.name if teacher else None,
        source_check=make_source_check(run, source, device, mask),
        fast=config.fast,
    )


def make_mask(config: Config) -> Mask | None:
    """Make the mask of a run, if it has one."""
    if config.mask is None:
        return None
    # Imported here: numba takes half a second.
    from ship_trl.policies.masks import load_mask

    return load_mask(config.mask, config.world)


def make_origin(
    run: Run, source: DuelingNetwork, env: ShipEnv, untrained: float, mask: Mask | None
) -> Origin:
    """Make what methods need of the source's function; `untrained` is an untrained network's return."""
    draw = env.observer(run.config.network)
    generator = Generator(device=env.device).manual_seed(run.stream("source's actions"))
    scale = run.config.learn.reward_scale
    # A source that this run trains has the run's own scale; of a file it is unknown.
    source_scale = scale if run.pretrained is None else REWARD_SCALE
    reached = mean_return(rollout(env, greedy_policy(source, draw, mask)))
    if run.arm.method == "qdagger" and reached <= untrained:
        console.say(
            f"the source returns {reached:.1f} here, an untrained network {untrained:.1f}: it is not followed"
        )
    return Origin(source, draw, generator, reached, untrained, source_scale, scale)


def show_demonstrations(run: Run, env: ShipEnv, algorithm: Algorithm) -> None:
    """Step through a run's demonstrations and let the algorithm observe the steps.

    Raises:
        ConfigError: a demonstration does not reach the return in its file.
    """
    folder = run.config.demonstrations
    for number, demonstration in enumerate(run.demonstrations, 1):
        current, total, done = env.reset(), 0.0, False
        for action in demonstration.actions:
            chosen = torch.full(env.batch_size, action, device=env.device)
            stepped, current = env.step_and_maybe_reset(current.set("action", chosen))
            # All environments of the batch do the same.
            algorithm.observe(stepped[:1])
            total += float(stepped["next", "reward"][0])
            done = bool(stepped["next", "done"][0])
            if done:
                break
        if not done or abs(total - demonstration.episode_return) > RETURN_TOLERANCE:
            raise ConfigError(
                f"demonstrations: number {number} of case {demonstration.case} in {folder} "
                f"claims a return of {demonstration.episode_return:.2f}, but reaches {total:.2f}"
            )


def measure_jumpstart(run: Run, algorithm: Algorithm, eval_env: ShipEnv) -> list[float]:
    """Return greedy returns before training, for random draws of the layers that are not copied.

    Of a suite, each draw has one episode, with a start of its own.
    """
    count, network = run.config.learn.jumpstart_draws, algorithm.network
    copied = run.arm.copied(network.all_layers, network.layer_names)
    if count == 0:
        return []
    if len(copied) == len(network.all_layers) or network.reused is not None:
        # The other layers, if any, change nothing before training.
        return [mean_return(rollout(eval_env, algorithm.greedy))]
    starts, generator = (Generator().manual_seed(run.stream(name)) for name in ("draw starts", "jumpstart"))
    given: dict[str, Any] = {"num_envs": min(count, JUMPSTART_BATCH), "generator": starts}
    if algorithm.mask is not None:
        given["encoders"] = {ACTION_MASK: algorithm.mask}
    env = make_run_env(run, run.target, eval_env.device, **given)
    return jumpstart(env, algorithm.draw, network, copied, count, generator)


# Evaluations on the source in a run, evenly, the first and the last included. They take about 1 % of a run of
# pixels and 2 % of one of vectors in profile quick; at each of its 121 evaluations 4 % and 9 %.
MAX_EVALUATIONS = 20


@dataclass(frozen=True)
class Source:
    """The weights that a transfer copies from, and their origin for people."""

    weights: Weights
    origin: str


def read_source(run: Run, entry: StoredNetwork | None = None) -> Source | None:
    """Read or draw the source's weights as the run's arm asks; return None for a run from scratch.

    `entry` is the source network in the case base; None if it is bundled, a file, or random.
    """
    if run.arm.is_scratch:
        return None
    config = run.config
    actions = len(config.world.actions)
    network = make_network(config.network, actions, Generator(), colour=config.colour)
    if run.arm.weights is SourceWeights.random:
        # An untrained network with the target's layers, drawn from a random stream of its own.
        network.reset(Generator().manual_seed(run.stream("random source")))
        return Source(network.state_dict(), SourceWeights.random.value)
    if run.pretrained:
        path, key, origin = run.pretrained.file, "source", f"{PRETRAINED}:{run.pretrained.name}"
    elif entry:
        path, key, origin = entry.policy, "case_base", str(entry.policy)
    else:
        path, key, origin = Path(str(config.source_file)), "source_file", str(config.source_file)
    copied = run.arm.copied(network.all_layers, network.layer_names)
    # A source may have another number of actions where its Q-values are neither copied nor asked for.
    needs_all = forms()[run.arm.method].uses_function or "advantage" in copied
    weights = load_weights(path, network, key, free=() if needs_all else ("advantage",))
    if run.arm.weights is SourceWeights.permuted:
        weights = permute_values(weights, Generator().manual_seed(run.stream("permuted source")))
    return Source(weights, origin)


@dataclass(frozen=True)
class SourceCheck:
    """Measures greedy returns on the source; it draws no random number and changes nothing of the training.

    `env` begins each case of the source once, `draw` maps states to the network's input, and
    `source_return` is the source network's own return.
    """

    env: ShipEnv
    draw: Draw
    learn: Learn
    mask: Mask | None
    source_return: float = math.nan

    def measure(self, network: DuelingNetwork) -> float:
        """Return the mean greedy return of a network on the source."""
        return mean_return(rollout(self.env, greedy_policy(network, self.draw, self.mask)))

    def add(self, row: Row, network: DuelingNetwork) -> Row:
        """Add the return on the source to the row of an evaluation of `network`, if it is due."""
        is_due = "greedy_return" in row and is_measured(row["episode"], self.learn)
        return row | {"source_return": self.measure(network)} if is_due else row


def is_measured(episode: int, learn: Learn) -> bool:
    """Return whether the evaluation after `episode` training episodes is measured on the source too."""
    last, number = (math.ceil(n / learn.evaluate_every) for n in (learn.episodes, episode))
    steps = min(MAX_EVALUATIONS - 1, last)
    return number == 0 or number * steps // last > (number - 1) * steps // last


def make_run_env(run: Run, suite: Suite, device: torch.device, **given: Any) -> ShipEnv:
    """Make an environment with the settings of a run and those that are `given`."""
    config = run.config
    given |= {"colour": config.colour, "vector_time": config.network.vector_time}
    return make_env(suite, config.world, device=device, fast=config.fast, **given)


def make_source_check(
    run: Run, source: Source | None, device: torch.device, mask: Mask | None
) -> SourceCheck | None:
    """Make the check of a transfer on its source; None if the source is drawn or has other actions."""
    if source is None or run.source_suite is None:
        return None
    config, suite = run.config, run.source_suite
    network = make_network(config.network, len(config.world.actions), Generator(), colour=config.colour)
    if source.weights.keys() != network.state_dict().keys():
        return None
    network.load_state_dict(dict(source.weights))
    starts = make_starts(suite, config.world).balanced(len(suite.cases), Generator())
    env = make_run_env(run, suite, device, starts=starts)
    check = SourceCheck(env, env.observer(config.network), config.learn, mask)
    return replace(check, source_return=check.measure(network.to(device)))


def read_teacher(teacher: TeacherFile, env: ShipEnv, config: Config) -> Teacher:
    """Return the teacher's Q-values in the run's scaled rewards, of states, by its backend and precision.

    Raises:
        ConfigError: the file is invalid, or its network has other actions.
    """
    network = load_network(teacher.path, env, TEACHER)
    observe = env.observer(network.config, network.colour)
    network.backend = make_backend(network, observe, config.learn, accelerator(config.fast).backend)
    return lambda state: teacher.factor * network(observe(state))
