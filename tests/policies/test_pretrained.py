"""The bundled networks match their manifest, and runs can start from them."""

import hashlib
from dataclasses import replace

import pytest
import torch
from safetensors.torch import load_file

import ship_trl as package
from ship_trl.config.errors import ConfigError
from ship_trl.fast.worlds import make_env
from ship_trl.learn.rollout import rollout
from ship_trl.policies import pretrained
from ship_trl.policies.reference import best_known
from ship_trl.run.entries import find_entries
from ship_trl.run.pretrain import SUITES, TESTS, rollout_greedy
from ship_trl.sim.cases import Perturbation, load_case, load_suite, load_world
from tests.cli.test_evaluate import table

WORLD = load_world()


def test_each_bundled_case_has_a_network_that_matches_the_manifest() -> None:
    cases = {case.name for case in load_suite("paper", WORLD).cases} | {"ship"}
    assert {one.name for one in pretrained.networks()} >= cases
    for one in pretrained.networks():
        assert hashlib.sha256(one.file.read_bytes()).hexdigest() == one.sha256
        assert one.fingerprint == load_suite(one.name, WORLD).fingerprint
        assert {str(value.dtype) for value in load_file(one.file).values()} == {f"torch.{one.dtype}"}


def test_every_score_is_reached(capsys: pytest.CaptureFixture[str]) -> None:
    rows = {row[0]: row for row in table(capsys)}
    assert set(rows) == {one.name for one in pretrained.networks()}
    for one in pretrained.networks():
        _, _, reached, share, outcome, _, length, claimed = rows[one.name]
        assert reached == claimed == f"{one.episode_return:.1f}"
        assert (share, outcome, length) == (f"{one.of_best_known:.0%}", one.outcome, str(one.length))


def test_a_policy_in_one_line() -> None:
    case = load_case("4", WORLD)
    episode = rollout(make_env(case, WORLD), package.load_policy("4"))[0]
    (bundled,) = [one for one in pretrained.networks() if one.name == "4"]
    assert episode.episode_return == pytest.approx(bundled.episode_return)
    elsewhere = rollout(make_env(load_case("2", WORLD), WORLD), package.load_policy("4", case="2"))[0]
    assert torch.equal(elsewhere.states[0, :3], torch.tensor([0.0, 0.0, torch.pi / 2]))
    best = rollout(make_env(case, WORLD), package.load_policy("best_known", case="4"))[0]
    assert best.episode_return == pytest.approx(best_known(case, WORLD).episode_return)
    with pytest.raises(ConfigError, match="policy: pretrained names several networks; allowed: one"):
        package.load_policy("pretrained")
    for case_name in (None, "4"):
        with pytest.raises(ConfigError, match=r"policy: no x; allowed: 1, 2, .* traffic_pixels, random, "):
            package.load_policy("x", case_name)
    with pytest.raises(ConfigError, match=r"policy: no file none\.safetensors"):
        package.load_policy("none.safetensors")


def test_suites_have_the_network_of_random_encounters(monkeypatch: pytest.MonkeyPatch) -> None:
    rates, drawn = {"imazu": 0.9}, Perturbation(own_heading=5.0)
    own = pretrained.SuiteNetwork(
        "traffic", "traffic", "scratch", 0, "", "float16", "", "vector", rates, rates
    )
    seeing = replace(own, name="traffic_pixels", observation="pixels")
    monkeypatch.setattr(pretrained, "suites", lambda: (own, seeing))
    for name in ("traffic", "traffic_test", "imazu", "imazu_perturbed", "paper", "imazu07"):
        assert pretrained.find("pretrained", load_suite(name, WORLD)) == own
    assert pretrained.find("pretrained", load_suite("imazu", WORLD, perturbation=drawn)) == own
    # A run takes one that observes what it does.
    assert pretrained.find("pretrained", load_suite("imazu", WORLD), observation="pixels") == seeing
    assert pretrained.find("pretrained:traffic", load_suite("4", WORLD)) == own
    # A case of the paper has its own, also from drawn starts.
    assert pretrained.find("pretrained", load_suite("4", WORLD, perturbation=drawn)).name == "4"
    (entry,) = find_entries(["pretrained:traffic"], False)
    assert (entry.suite.name, entry.claimed) == ("traffic", None)
    monkeypatch.setattr(pretrained, "suites", tuple)
    with pytest.raises(ConfigError, match="policy: no bundled network of suite imazu; allowed: 1, "):
        pretrained.find("pretrained", load_suite("imazu", WORLD))


def test_the_networks_of_random_encounters_are_what_the_manifest_says() -> None:
    assert [one.name for one in pretrained.suites()] == list(SUITES)
    for one in pretrained.suites():
        assert hashlib.sha256(one.file.read_bytes()).hexdigest() == one.sha256
        assert {str(value.dtype) for value in load_file(one.file).values()} == {f"torch.{one.dtype}"}
        rates = one.success_rates_by_seed
        assert [*rates] == [str(seed) for seed in SUITES[one.name][0]]
        assert one.seed == SUITES[one.name][0][0]
        episodes, network = rollout_greedy(load_suite("imazu", WORLD), one.file)
        assert network.observes == one.observation
        assert [*one.success_rates] == list(TESTS)
        assert one.success_rates["imazu"] == sum(episode.goal for episode in episodes) / 22
