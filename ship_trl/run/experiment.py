"""One run: source network -> transfer -> training on the target case -> result."""

from __future__ import annotations

import copy
import math
import platform
import time
from pathlib import Path

import torch
from torch import Generator

from ship_trl import __version__
from ship_trl.architecture import others
from ship_trl.config import ConfigError, Method, SourceWeights
from ship_trl.learn.agent import Agent
from ship_trl.learn.backend import computing
from ship_trl.learn.jumpstart import jumpstart
from ship_trl.learn.network import DuelingNetwork
from ship_trl.learn.policy import greedy_policy
from ship_trl.learn.rollout import Episode, rollout
from ship_trl.learn.train import Evaluated, Finished, train
from ship_trl.pretrained import PRETRAINED
from ship_trl.result import SCHEMA_VERSION, Evaluation, Result, write_result
from ship_trl.run import console
from ship_trl.run.demonstrate import show_demonstrations
from ship_trl.run.plan import ALGORITHM_VERSION, Run, check_folder
from ship_trl.run.process import configure_process
from ship_trl.run.scratch import scratch_returns
from ship_trl.run.tracking import Tracker
from ship_trl.sim.env import ShipEnv
from ship_trl.sim.random_policy import random_return
from ship_trl.sim.reference import best_known
from ship_trl.sim.render import Rasteriser
from ship_trl.transfer.casebase import POLICY, POLICY_LAST, CaseBase, Entry
from ship_trl.transfer.layers import Transfer, apply, load_weights, permuted, save_weights
from ship_trl.view.curve import draw_curve
from ship_trl.view.film import write_gif
from ship_trl.view.transfer import draw_transfer

# So many networks sail side by side before training; each takes 3 MB.
FLEET = 25
# Below the case base, beside the networks of the cases.
PLANS = ".plans"


def run_experiment(run: Run, place: str = "") -> Result:
    """Train a run, its source first where the case base has none, and return its result.

    A finished run of the same settings is shown again, not trained again. A run of a grid shows
    less of itself; `place` is its place there, as `3 of 40`.
    """
    configure_process()
    device = torch.device(run.config.device)
    if device.type == "cuda" and not torch.cuda.is_available():
        raise ConfigError("device: no CUDA device is available here; allowed: cpu")
    if run.config.source_file is not None or run.pretrained is not None:
        # Refused before anything is written.
        config = run.config
        network = DuelingNetwork(
            3 if config.colour else 1, len(config.world.actions), Generator(), config.network
        )
        path, key = source_weights(run, None)
        load_weights(path, network, key)
    # Of two processes that are asked for the same run, as after a study was killed and started again,
    # the second waits and finds it done.
    with console.held(run.lock(), run.title):
        result = run.result()
        if result is None:
            # It may have finished other settings in this folder since this run was planned.
            check_folder(run)
            source = find_source(run, place)
            result = train_run(run, device, source, place)
        else:
            console.say(f"{run.folder} holds this run already; another seed= or output= trains one")
    retain(run, result)
    console.say_result(result, run.folder, place) if place else console.show_result(result, run.folder)
    return result


def find_source(run: Run, place: str) -> Entry | None:
    """Find the source network of a transfer in the case base, or train and retain it first.

    Of several processes that want the same one, the first trains it and the others wait.
    """
    source = run.source
    if source is None:
        return None
    base, device = CaseBase(Path(source.config.case_base)), torch.device(source.config.device)
    wanted = (source.target, source.config.arm, source.config.seed, source.config_hash)
    with console.held(base.lock(*wanted), source.title):
        entry = base.find(*wanted)
        if entry is None:
            # It may be asked for as a run of its own at the same time.
            with console.held(source.lock(), source.title):
                result = source.result()
                if result is None:
                    check_folder(source)
                    console.say(f"two trainings: first the source, {source.title}; then {run.title}")
                    result = train_run(source, device, None, place)
            return retain(source, result)
    console.say(f"source: {entry.policy} (greedy return {entry.best_return:.1f})")
    return entry


def retain(run: Run, result: Result) -> Entry:
    """Keep a finished run's network in the case base, for later targets (section 4.2)."""
    values = result.to_json()
    scores = {key: values[key] for key in ("best", "final", "best_known_return")}
    arm = run.config.arm
    if run.config.method is not Method.scratch:
        arm += f"-from-{Path(str(run.config.source)).stem}"
    base = CaseBase(Path(run.config.case_base))
    network = others(run.config.network)
    return base.retain(run.target, arm, run.config.seed, run.config_hash, scores, run.folder, network)


def train_run(run: Run, device: torch.device, source: Entry | None, place: str = "") -> Result:
    """Train one network and write everything about it into the run's folder, `result.json` last."""
    config, learn, started = run.config, run.config.learn, time.perf_counter()
    # At once: the planner and the draws before training take their time.
    console.say(f"{place}: {run.title}" if place else run.title)
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
    draws = find_draws(run, agent, eval_env)
    known = best_known(run.target, config.world, Path(config.case_base) / PLANS).episode_return

    finished: list[Finished] = []
    evaluated: list[Evaluated] = []
    best: Evaluated | None = None
    with Tracker(run) as tracker:
        events = train(env, eval_env, agent, replay, learn)
        for event in console.progress(run.title, learn.episodes, events, place):
            tracker.log(event)
            if isinstance(event, Finished):
                finished.append(event)
                continue
            evaluated.append(event)
            # Of equals the later: in case 1 a network that has learned nothing may keep course.
            if best is None or event.sailed.episode_return >= best.sailed.episode_return:
                best = event
                noted = {"config_hash": run.config_hash, "episode": event.episode}
                save_weights(run.folder / POLICY, agent.target_network, noted)
        assert best is not None
        last = evaluated[-1]
        save_weights(
            run.folder / POLICY_LAST,
            agent.target_network,
            {"config_hash": run.config_hash, "episode": last.episode},
        )
        greedy = [(e.episode, e.sailed.episode_return, e.sailed.outcome) for e in evaluated]
        draw_curve(run.folder / "curve.png", finished, greedy, known, run.title)
        if transfer and (scratch_curves := scratch_returns(run)) is not None:
            returns = [f.episode_return for f in finished]
            draw_transfer(
                run.folder / console.TRANSFER, config.arm, returns, scratch_curves, known, run.title
            )
        write_gif(run.folder / "episode.gif", run.target, config.world, best.sailed, draw, run.title)
        result = Result(
            pair=config.label,
            source=None if config.method is Method.scratch else str(config.source),
            target=str(config.target),
            method=config.method.value,
            layers=config.layers,
            arm=config.arm,
            seed=config.seed,
            profile=config.profile,
            config_hash=run.config_hash,
            source_network=None if transfer is None else origin(run, source),
            best_known_return=known,
            random_return=random_return(run.target, config.world),
            scratch=evaluation(scratch, 0),
            before=evaluation(evaluated[0].sailed, 0),
            best=evaluation(best.sailed, best.episode),
            final=evaluation(last.sailed, last.episode),
            draws=draws,
            episodes=learn.episodes,
            steps=last.steps,
            training_goal_rate=sum(f.outcome == "goal" for f in finished) / len(finished),
            training_collision_rate=sum(f.outcome == "collision" for f in finished) / len(finished),
            device=str(device),
            precision=str(computing(learn.precision, device)).removeprefix("torch."),
            backend=agent.backend.name,
            algorithm_version=ALGORITHM_VERSION,
            schema_version=SCHEMA_VERSION,
            ship_trl=__version__,
            torch=torch.__version__,
            processor=platform.machine(),
            seconds=round(time.perf_counter() - started, 1),
        )
        tracker.finish(result)
    write_result(run.folder, result)
    return result


def origin(run: Run, source: Entry | None) -> str:
    """Say where the weights of a transfer came from."""
    if run.config.source_weights is SourceWeights.random:
        return "random"
    if run.pretrained:
        return f"{PRETRAINED}:{run.pretrained.case}"
    return str(source.policy if source else run.config.source_file)


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


def find_draws(run: Run, agent: Agent, eval_env: ShipEnv) -> list[float]:
    """Greedy returns before training over many draws of what is not copied; one where all is."""
    config = run.config
    count, layers = config.learn.jumpstart_draws, config.layers or 0
    if count == 0:
        return []
    if layers == "all":
        return [rollout(eval_env, agent.greedy)[0].episode_return]
    env = ShipEnv(
        run.target, config.world, min(count, FLEET), colour=config.colour, device=str(eval_env.device)
    )
    generator = Generator().manual_seed(run.stream("jumpstart"))
    return jumpstart(env, agent.draw, agent.network, layers, count, generator)


def evaluation(episode: Episode, at: int) -> Evaluation:
    """Give a greedy episode as numbers; without target ships there is no DCPA."""
    dcpa = episode.dcpa if math.isfinite(episode.dcpa) else None
    return Evaluation(episode.episode_return, episode.outcome, episode.length, dcpa, at)
