"""Every wrong value of a configuration is refused in one line, and changes nothing."""

import sys
from pathlib import Path

import pytest

from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import conf_dir
from ship_trl.config.types import BFLOAT16, LOGGERS
from ship_trl.grid.compose import compose_config
from ship_trl.run.plan import make_run
from ship_trl.study.plan import to_study
from tests.command import ship_trl
from tests.config.test_config import HIGH, composed

# With lags own ship may have any speed of them with any rate of turn: 225 motions.
ACTIONS = f"[{','.join(f'[{k},{k / 100}]' for k in range(1, 16))}]"
WRONG = {
    "": "pair: none given",
    "+pair=high": "layers: must be 1, 2, 3, 4, all, head, body with method=finetune, got none; arm=NAME sets",
    "+pair=high method=guide layers=7": "layers: must be 1, 2, 3, 4, all, head, body, left out with",
    "+pair=high +arm=G algorithm=ppo": "method: must be another with an algorithm that has",
    "+pair=high +arm=QR algorithm=pupil algorithm.teacher=pretrained:4": "method: must be another with an al",
    "+pair=high +arm=QR source_weights=random": "source_weights: must be learned or pretrained with",
    "+pair=high +arm=FEH observation=vector": "layers: must be a number or all with observation=vector",
    "+pair=high +arm=G transfer.guide.schedule=x": "transfer.guide.schedule: must be 'belief', 'reuse' or 'j",
    "+pair=high +arm=SP3 transfer.l2sp.rate_decay=0.5": "transfer.l2sp.rate_decay: must be greater than or",
    "+pair=high method=scratch layers=2": "layers: must be left out with method=scratch",
    "+pair=high method=scratch source_weights=random": "source_weights: must be learned with method=scratch",
    "+pair=high layers=3 source_file=x source_weights=random": "source_weights: must be learned or",
    "+pair=high layers=3 source=pretrained source_weights=random": "source_weights: must be left out",
    "+pair=high layers=3 source=pretrained source_file=x": "source_file: must be left out with source=",
    "target=4": "source: must be a case with method=finetune; without one method=scratch, got none",
    "pair=high layers=3": "pair: write +pair=NAME; allowed: high, low, lowest",
    "+pair=high +arm=FE9": "layers: must be 1, 2, 3, 4, head with method=feature_extraction, got 9",
    "algorithm=ppo ++algorithm.clip=1 target=4": "algorithm.clip: unknown key; allowed here: rollout_steps",
    "target=1 method=scratch learn.lr.x=1": "learn.lr.x: unknown key; allowed here: ",
    "target=1 method=scratch +learn.lr=1": "learn.lr: it has a value; write learn.lr=VALUE",
    "source=1 target=2 layers=1 source_file=a/seed=0/b": "overrides: mismatched input '='",
    "+pair=high method=banana layers=2": "method: must be one of scratch, feature_extraction, finetune, unfr",
    "+pair=high layers=2 learn.backend=incremental network.conv=[[8,6,3],[8,27,1]]": "learn.backend: must be",
}
# Behind `+pair=high layers=3`.
WRONG_VALUES = {
    "world.reward.collision=200": "world.reward.collision: must be less than or equal to 0, got 200",
    "logger=banana": f'logger: must be one of {", ".join(LOGGERS)}, got "banana"',
    "learn.loss=l3": "learn.loss: must be 'l2'",
    "learn.backend=incremental fast=false": "learn.backend: must be auto or dense with fast=false, got inc",
    "learn.backend=incremental device=cuda": "learn.backend: must be auto or dense with",
    "seed=one": 'seed: must be a valid integer, got "one"',
    "learn.episodes=true": "learn.episodes: must be a number, got true",
    "learn.episodes=-5": "learn.episodes: must be greater than or equal to 1, got -5",
    "learn.replay_size=8": "learn.batch_size: must be at most learn.replay_size=8",
    "margin.penalty=30": "margin.distance: must be above world.safe_distance=45 with margin.penalty=30, got",
    "algorithm.build=sarsa": "algorithm.build: must be module:function or file.py:function, of a module or",
    "algorithm.build=ship_trl..x:build": "algorithm.build: must be module:function or file.py:function, of a",
    "algorithm.build='none.py:build'": "algorithm.build: must be module:function or file.py:function, of a",
    "+algorithm.steps=3": "algorithm.steps: unknown key; allowed here: none",
    "algorithm=n_step +algorithm.epochs=3": "algorithm.epochs: unknown key; allowed here: steps",
    "algorithm=ppo demonstrations=played": "demonstrations: must be left out with an algorithm",
    "margin.rules=-1": "margin.rules: ",
    "mask=shield": "mask: must be null, rules, module:function or file.py:function, of a module or file that",
    "mask='none.py:make'": "mask: must be null, rules, module:function or file.py:function, of a module or",
    "algorithm=ppo learn.num_envs=1": "algorithm.minibatch_size: must be at most 32 (rollout_steps of",
    "algorithm=pupil": "algorithm.teacher: must be a safetensors file, a result folder, or pretrained:NAME",
    "world.actions=[[0.0,0.1],[-1.0,0.0]]": "world.actions: must be at most 100 of [v in m/s,",
    "world.actions=[[15,0],[-1e9,0]]": "world.actions: must be at most 100 of [v in m/s,",
    "world.safe_distance=inf": "world.safe_distance: must be a finite number, got",
    "+typo=3": "typo: unknown key; allowed here: pair, source, target",
    "+world.give_way.cpa=2": "world.give_way.cpa: unknown key; allowed here: tcpa, dcpa, turn",
    "network.conv=[]": "network.conv: must be given without network.linear, got []",
    "network.conv=[[8,8.5,4]]": "network.conv[0][1]: must be a valid integer, got 8.5",
    "network.conv=[[8,8,4],[8,21,1]]": "network.conv[1][1]: must be 20, to cover the last map, got 21",
    "network.conv=[[8,85,4],[8,1,1]]": "network.conv[0][1]: must be at most 84, the side of its map, got 85",
    "network.conv=${nothing}": "network.conv: ",
    "observation=vector colour=true": "colour: must be false with observation=vector, got true",
    "observation=vector learn.backend=incremental": "learn.backend: must be auto or dense with observation=",
    "observation=vector network.per_ship=4": "network.per_ship: must be less than the 4 layers of",
    "observation=vector network.ships=0": "network.ships: must be given with network.linear, got 0",
    "observation=vector +network.vector_time=8": "network.vector_time: must be left out with network.linear",
    "+network.ships=3": "network.ships: must be left out without network.linear, got 3",
}
WRONG_VALUES |= {
    "learn.replay_size=1000000000": "learn.replay_size: must be at most 11831865 transitions (8 GB, 726 byte",
    "observation=vector learn.replay_size=100000000": "learn.replay_size: must be at most 11831865 transi",
    "method=feature_extraction learn.replay_size=2000000": "learn.replay_size: must be at most 647319 trans",
    "learn.num_envs=1000000": "learn.num_envs: must be at most 25226 observations (8 GB, 340512 byt",
    "learn.batch_size=30000 learn.replay_size=30000": "learn.batch_size: must be at most 25226 observations",
    "network.conv=[[4096,1,1],[4096,84,1]] layers=2": "network.conv: must be at most 429496729 weights ",
    "algorithm=ppo algorithm.minibatch_size=40000 algorithm.rollout_steps=10000": "algorithm.minibatch_size",
    "algorithm=ppo algorithm.rollout_steps=100000000": "algorithm.rollout_steps: must be at most ",
    f"world.turn_time=4 world.max_steps=1000 world.actions={ACTIONS}": "world.actions: must be at most 223",
    "world.dt=100 world.max_steps=1000": "world.actions: must be at most 1e+06 m in an episode, got 1.5e+0",
}


@pytest.mark.parametrize(
    ("line", "told"),
    [*WRONG.items(), *((f"+pair=high layers=3 {line}", told) for line, told in WRONG_VALUES.items())],
)
def test_wrong_values_are_refused(line: str, told: str) -> None:
    with pytest.raises(ConfigError) as caught:
        (compose_config if line in WRONG else composed)(*line.split())
    message = str(caught.value)
    assert message.startswith(told)
    assert "\n" not in message


def test_it_is_refused_before_torch_is_imported(tmp_path: Path) -> None:
    first = "import atexit, sys; atexit.register(lambda: print('torch' in sys.modules))"
    line = ("target=1", "method=scratch", "learn.batch_size=100000", "learn.replay_size=100000")
    assert ship_trl(*line, folder=tmp_path, code=1, first=first, new_process=True).stdout == "False\n"


@pytest.mark.parametrize("logger", ["tensorboard", "all"])
def test_tensorboard_is_refused_where_it_is_not_installed(
    logger: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    compose_config(*HIGH, f"logger={logger}")
    monkeypatch.setitem(sys.modules, "tensorboard", None)
    compose_config(*HIGH, "logger=wandb")
    message = r"^logger: tensorboard is not installed; run: pip install -e '.\[tensorboard\]'$"
    with pytest.raises(ConfigError, match=message):
        compose_config(*HIGH, f"logger={logger}")
    with pytest.raises(ConfigError, match=message):
        to_study([f"logger={logger}"])


def test_a_wrong_switch_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(BFLOAT16, "no")
    with pytest.raises(ConfigError, match=r"^SHIP_TRL_BFLOAT16: must be on or off, got no$"):
        compose_config(*HIGH)


UNRUNNABLE = {
    "target=9 method=scratch": "target: no case or suite 9; allowed: 1, 2, 3, 4, 5, 6, imazu01 to imazu22,",
    "source=9 target=1 layers=1": "source: no case or suite 9; allowed: 1,",
    "target=1 method=scratch world.max_steps=35": f"{conf_dir()}/case/1.yaml: goal: cannot be reached: 540 m",
    "target=1 method=scratch world.dt=0.1": f"{conf_dir()}/case/1.yaml: goal: cannot be reached: 540 m",
    "+pair=high layers=3 source_file=nowhere": "source_file: no file nowhere",
}


@pytest.mark.parametrize("line", UNRUNNABLE)
def test_a_missing_case_or_file_is_refused(line: str) -> None:
    with pytest.raises(ConfigError) as caught:
        make_run(compose_config(*line.split()))
    assert str(caught.value).startswith(UNRUNNABLE[line])
