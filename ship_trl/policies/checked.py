"""A loaded policy of any kind, which refuses what it cannot read."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from tensordict import TensorDict, TensorDictBase
from tensordict.nn import TensorDictModuleBase, TensorDictSequential
from torch import Tensor

from ship_trl.config.errors import ConfigError, require
from ship_trl.config.imports import name_in_errors
from ship_trl.config.network import load_network, vector_part
from ship_trl.learn.rollout import Policy
from ship_trl.sim.state import OWN_SIZE, SHIP_SIZE
from ship_trl.transfer.weights import Look

STATES = f"float32 [N, {OWN_SIZE} + {SHIP_SIZE} a ship]"


class CheckedPolicy(TensorDictModuleBase):
    """A policy: TorchRL calls it with a tensordict, and `predict` is that of Stable-Baselines3.

    Args:
        policy: reads `state`, float32 [N, S], and writes `action`. With a `look` it is a sequence of two
            modules: one observes the states, one acts on the observations.
        look: what it observes; None for a policy that reads the states alone.
        name: its name in messages.
        own_actions: of a user's policy, how many actions there are; else 0.

    Attributes:
        observation: what `predict` takes: "pixels", "vector" or "state".
        env_options: arguments with which `gymnasium.make` gives this observation; "state" is in its `info`.
    """

    def __init__(self, policy: Policy, look: Look | None, name: str, own_actions: int = 0) -> None:
        super().__init__()
        self.policy, self.name, self.own_actions = policy, name, own_actions
        self.in_keys, self.out_keys = ["state"], ["action"]
        self.observation, self.env_options = "state", dict[str, Any]()
        # Of one observation, the channels of pixels first; empty for a state.
        self._shape: tuple[int, ...] = ()
        if look is not None:
            self.observation, self._shape = look.observes, look.shape
            self.env_options["observation"] = look.observes
        if look is not None and look.observes == "pixels":
            self.env_options |= {"colour": look.colour, "vector_time": look.network.vector_time}
        whole = load_network("vector")
        # Where it sees a part of Gymnasium's vector.
        self._part: list[int] | None = None
        if look is not None and look.observes == "vector" and look.network.inputs < whole.inputs:
            self._part = vector_part(look.network, whole)
            self._whole = whole.inputs

    @torch.no_grad()
    def predict(
        self, observation: Any, state: object = None, episode_start: object = None, deterministic: bool = True
    ) -> tuple[NDArray[np.int64], None]:
        """Choose the action for an observation, or an action for each of a batch.

        Args:
            observation: an array of the kind `observation`, or a batch of them: pixels, uint8 [84, 84, C] or
                [C, 84, 84]; a vector, float32 [F]; or a scene, float32 [S].
            state: ignored, as is `episode_start`: no policy has a hidden state.
            episode_start: ignored.
            deterministic: must be true, because networks act greedily.

        Returns:
            The action, int64 [], or [N] for a batch; and None.

        Raises:
            ConfigError: it is another kind of observation, or of another shape or type.
        """
        require(deterministic, "deterministic", f"True: {self.name} acts greedily", deterministic)
        given, shape = np.asarray(observation), self._shape
        dtype = np.uint8 if self.observation == "pixels" else np.float32
        if self._part is not None and given.shape[-1:] == (self._whole,):
            given = given[..., self._part]
        if len(shape) > 1 and given.shape[-3:] == (*shape[1:], shape[0]):
            given = np.moveaxis(given, -1, -3)
        elif has_state_size(given) and not shape:
            shape = given.shape[-1:]
        ends = given.ndim - len(shape)
        if not shape or ends not in (0, 1) or given.shape[ends:] != shape or given.dtype != dtype:
            raise ConfigError(f"policy: {self.name} takes {self._allowed()}; got {describe(observation)}")
        rows = torch.from_numpy(given.reshape(-1, *shape).copy())
        step = TensorDict({self.observation: rows}, batch_size=[len(rows)])
        act: Any = self.policy[1] if isinstance(self.policy, TensorDictSequential) and self._shape else self
        action: NDArray[np.int64] = act(step)["action"].numpy()
        return action.reshape(given.shape[:ends]), None

    def _allowed(self) -> str:
        """Describe what `predict` takes."""
        if not self._shape:
            return f"the scene, info['state'], {STATES} or without N"
        options = ", ".join(f"{key}={value!r}" for key, value in self.env_options.items())
        channels, *sides = self._shape
        channels = channels if self._part is None else self._whole
        given = f"uint8 {[*sides, channels]}" if sides else f"float32 {[channels]}"
        return f"{self.observation}, {given} or a batch, as gymnasium.make(..., {options}) gives them"

    def forward(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Write `action` into a tensordict.

        Raises:
            ConfigError: it has no states, or a user's policy fails or writes an invalid action.
        """
        state = tensordict.get("state", None) if isinstance(tensordict, TensorDictBase) else None
        if not (isinstance(state, Tensor) and state.dtype == torch.float32 and has_state_size(state)):
            got = describe(tensordict if state is None else state)
            allowed = f"a tensordict with `state`, {STATES}, see sim/state.py"
            raise ConfigError(f"policy: {self.name} is called with {got}; allowed: {allowed}")
        if not self.own_actions:
            return self.policy(tensordict)
        batch_size, last = tensordict.batch_size, self.own_actions - 1
        with name_in_errors(f"policy: {self.name} fails"):
            written = self.policy(tensordict)
        action: Any = written.get("action", None) if isinstance(written, TensorDictBase) else None
        is_index = isinstance(action, Tensor) and action.dtype == torch.int64 and action.shape == batch_size
        if not (is_index and bool(((action >= 0) & (action <= last)).all())):
            got = f"{action.tolist()!s:.60}" if is_index else describe(action)
            allowed = f"int64 {list(batch_size)} from 0 to {last}, in its tensordict"
            raise ConfigError(f"policy: {self.name} writes action {got}; allowed: {allowed}")
        return written


def has_state_size(values: NDArray[Any] | Tensor) -> bool:
    """Return whether the last dimension may be that of states, see `sim.state`."""
    places = values.shape[-1] - OWN_SIZE if values.ndim else -1
    return places >= 0 == places % SHIP_SIZE


def describe(value: object) -> str:
    """Describe a wrong value in a few words: kind and shape of an array, keys of a tensordict."""
    if isinstance(value, TensorDictBase):
        return f"a tensordict with {', '.join(sorted(map(str, value.keys()))) or 'nothing'}"
    if hasattr(value, "dtype") and hasattr(value, "shape"):
        return f"{str(value.dtype).removeprefix('torch.')} {list(value.shape)}"
    return f"{value!r:.40}"
