"""Which policy is shown on which case, and what comes next; episodes are rolled out on demand and kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ship_trl.config.errors import ConfigError
from ship_trl.policies.entry import Entry, rollout_entry
from ship_trl.policies.named import network_of
from ship_trl.sim.cases import Case, case_names, load_case
from ship_trl.view.episode_view import EpisodeView
from ship_trl.view.telemetry import measure_episode

# Letters of a policy's name; the end of a path tells more than its beginning.
MAX_TITLE = 44


class Playlist:
    """Goes through the policies and cases of a command line, one policy at a time or two beside each other.

    `seed` is for the first episode of policies that draw; each further episode has the next one.

    Raises:
        ConfigError: there is only one policy to compare.
    """

    def __init__(self, entries: Sequence[Entry], compare: bool = False, seed: int = 0) -> None:
        self.policies = list({entry.policy: entry for entry in reversed(entries)}.values())[::-1]
        self.cases = distinct([entry.case for entry in entries])
        # With `target=1,4` every policy has every case; otherwise each has one of its own.
        is_crossed = len(entries) == len(self.policies) * len(self.cases)
        self._has_own_cases = len(self.cases) > 1 and not is_crossed
        if len(self.cases) == 1 or self._has_own_cases:
            self.cases = distinct([*self.cases, *(load_case(n, entries[0].world) for n in case_names())])
        if compare and len(self.policies) < 2:
            raise ConfigError(f"--compare: needs two policies, got {self.policies[0].label} alone")
        self.compare, self.seed = compare, seed
        self.policy, self.case, self.episode = int(compare), self.policies[0].case, 0
        self._views: dict[tuple[str, str, int], EpisodeView] = {}

    def views(self) -> list[EpisodeView]:
        """Return what is shown now, one episode or two of the same case.

        Raises:
            ConfigError: a policy cannot be loaded, or not for this case.
        """
        places = [0, self.policy] if self.compare else [self.policy]
        return [self._view(replace(self.policies[place], case=self.case)) for place in places]

    def next_policy(self) -> None:
        """Go to the next policy, beside the first one if two are compared, on its own case if it has one."""
        first = int(self.compare)
        self.policy = first + (self.policy - first + 1) % (len(self.policies) - first)
        if self._has_own_cases and not self.compare:
            self.case = self.policies[self.policy].case

    def next_case(self) -> None:
        """Go to the next of the given cases; if there is one only, of all cases."""
        marks = [case.fingerprint for case in self.cases]
        self.case = self.cases[(marks.index(self.case.fingerprint) + 1) % len(self.cases)]

    def next_episode(self) -> None:
        """Roll out once more: policies that draw do so again, all others repeat themselves."""
        self.episode += 1

    def _view(self, entry: Entry) -> EpisodeView:
        key = (entry.policy, entry.case.fingerprint, self.episode)
        if key not in self._views:
            self._views[key] = view_episode(entry, self.seed + self.episode, self.episode + 1)
        return self._views[key]


def view_episode(entry: Entry, seed: int, episode: int = 1) -> EpisodeView:
    """Roll out an entry, and return what is shown of it; its title says which episode it is from 2 on.

    Raises:
        ConfigError: the policy cannot be loaded.
    """
    env, policy, episodes = rollout_entry(entry, seed=seed)
    title = shorten(entry.label) + (f", episode {episode}" if episode > 1 else "")
    telemetry = measure_episode(entry.case, entry.world, episodes[0])
    return EpisodeView(title, telemetry, env.rasteriser, network_of(policy))


def distinct(cases: Sequence[Case]) -> list[Case]:
    """Leave out repeated cases, also under other names."""
    return list({case.fingerprint: case for case in reversed(cases)}.values())[::-1]


def shorten(label: str) -> str:
    """Leave out the first folders of a long path."""
    while len(label) > MAX_TITLE and "/" in label:
        label = label.split("/", 1)[1]
    return label
