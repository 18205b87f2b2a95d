"""Which policy is shown on which case, and what comes next; each is sailed when it is asked for, and kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ship_trl.config.errors import ConfigError
from ship_trl.policies.entry import Entry, sail
from ship_trl.policies.named import network_of
from ship_trl.sim.cases import Case, case_names, load_case
from ship_trl.viewer.show import Show, make_show
from ship_trl.viewer.telemetry import of_episode

# Letters of a policy's name; of a path its end tells more than its beginning.
LONGEST = 44


class Playlist:
    """Goes through policies and cases, one policy at a time or two beside each other.

    Args:
        entries: what the command line named, at least one.
        compare: show the first policy beside another.
        seed: of the first episode of policies that draw; each further episode has the next one.

    Raises:
        ConfigError: there is only one policy to compare.
    """

    def __init__(self, entries: Sequence[Entry], compare: bool = False, seed: int = 0) -> None:
        self.policies: list[Entry] = []
        for entry in entries:
            if all(entry.policy != other.policy for other in self.policies):
                self.policies.append(entry)
        self.cases = distinct([entry.case for entry in entries])
        # With `target=1,4` every policy sails every case; otherwise each has one of its own.
        crossed = len(entries) == len(self.policies) * len(self.cases)
        self._own_cases = len(self.cases) > 1 and not crossed
        if len(self.cases) == 1 or self._own_cases:
            self.cases = distinct([*self.cases, *(load_case(n, entries[0].world) for n in case_names())])
        if compare and len(self.policies) < 2:
            raise ConfigError(f"--compare: needs two policies, got {self.policies[0].label} alone")
        self.compare, self.seed = compare, seed
        self.policy, self.case, self.episode = int(compare), self.policies[0].case, 0
        self._sailed: dict[tuple[str, str, int], Show] = {}

    def shows(self) -> list[Show]:
        """Give what is to be shown now, one episode or two of the same case.

        Raises:
            ConfigError: a policy cannot be loaded, or not for this case.
        """
        chosen = (
            [self.policies[0], self.policies[self.policy]] if self.compare else [self.policies[self.policy]]
        )
        return [self._show(replace(entry, case=self.case)) for entry in chosen]

    def next_policy(self, forward: int = 1) -> None:
        """Go to the next policy, beside the first one if two are compared, on its own case if it has one."""
        first = int(self.compare)
        self.policy = first + (self.policy - first + forward) % (len(self.policies) - first)
        if self._own_cases and not self.compare:
            self.case = self.policies[self.policy].case

    def next_case(self, forward: int = 1) -> None:
        """Go to the next of the cases that were given; of all there are, if it was one."""
        marks = [case.fingerprint for case in self.cases]
        self.case = self.cases[(marks.index(self.case.fingerprint) + forward) % len(self.cases)]

    def next_episode(self) -> None:
        """Sail once more: policies that draw do so anew, all others do the same again."""
        self.episode += 1

    def _show(self, entry: Entry) -> Show:
        key = (entry.policy, entry.case.fingerprint, self.episode)
        if key not in self._sailed:
            self._sailed[key] = sail_show(entry, self.seed + self.episode, str(self.episode + 1))
        return self._sailed[key]


def sail_show(entry: Entry, seed: int, episode: str = "1") -> Show:
    """Sail one episode, and make what is shown of it.

    Raises:
        ConfigError: the policy cannot be loaded.
    """
    env, policy, sailed = sail(entry, seed=seed)
    numbers = of_episode(entry.case, entry.world, sailed[0])
    return make_show(short(entry.label), numbers, env.rasteriser, network_of(policy), episode)


def distinct(cases: Sequence[Case]) -> list[Case]:
    """Leave out cases that have been there before, whatever they are called."""
    return list({case.fingerprint: case for case in reversed(cases)}.values())[::-1]


def short(label: str) -> str:
    """Leave out the first folders of a long path."""
    while len(label) > LONGEST and "/" in label:
        label = label.split("/", 1)[1]
    return label
