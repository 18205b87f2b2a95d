"""`python -m ship_trl evaluate`: any policy on any case, and whether a folder holds what it claims."""

import csv
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from ship_trl import load_policy
from ship_trl.cli.evaluate import MILES_OF_ALL, SCORES, main
from ship_trl.config.errors import ConfigError
from ship_trl.policies.registry import POLICIES
from tests.command import SMOKE, refused, ship_trl


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("evaluate")
    ship_trl(*SMOKE, "target=2", "method=scratch", "output=runs", folder=folder)
    return folder / "runs"


def table(capsys: pytest.CaptureFixture[str], *words: str) -> list[list[str]]:
    main([*words, "--all", "--markdown"])
    lines = capsys.readouterr().out.splitlines()[2:]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")]


def scores(capsys: pytest.CaptureFixture[str], *words: str) -> list[dict[str, str]]:
    headings = [heading for heading in SCORES if heading != MILES_OF_ALL]
    return [dict(zip(headings, row, strict=True)) for row in table(capsys, *words)]


def test_policies_without_training(capsys: pytest.CaptureFixture[str]) -> None:
    rows = table(capsys, "random", "keep_course", "best_known", "target=1,4")
    assert [row[:2] for row in rows] == [
        [c, p] for p in ("random", "keep_course", "best_known") for c in "14"
    ]
    kept = {row[0]: row[2:] for row in rows if row[1] == "keep_course"}
    assert kept["1"][:3] == ["83.9", "100%", "goal"] and kept["4"][2] == "collision"
    best = [row for row in rows if row[1] == "best_known"]
    assert [row[3] for row in best] == ["100%", "100%"] and best[1][5] == "45"


def test_a_suite_is_its_cases_in_turn(capsys: pytest.CaptureFixture[str]) -> None:
    kept, best, other = scores(capsys, "keep_course", "best_known", "pretrained:3", "target=paper")
    # Keeping the course reaches the goal in cases 1, 2 and new.
    assert (kept["success"], kept["collision"]) == ("43% (16 to 75)", "57% (25 to 84)")
    assert (best["success"], best["of best known"]) == ("100% (65 to 100)", "100%")
    # The mean over the ships of cases 3 to 6; nobody is met head-on.
    assert kept["R8"] == kept["R15"] == "0.00" and kept["R14"] == kept["R13"] == "-"
    assert kept["path"] == "1.00" and float(best["path"]) > 1 and float(best["ms"]) > 0
    assert other["policy"] == "pretrained:3"
    # Copies of an episode would only narrow the intervals.
    kept, drawn = scores(capsys, "keep_course", "random", "target=paper", "--episodes", "14")
    assert kept["success"] == "43% (16 to 75)" and (kept["episodes"], drawn["episodes"]) == ("7", "14")


def test_success_by_policy_and_suite_stands_first(capsys: pytest.CaptureFixture[str]) -> None:
    main(["keep_course", "vo", "target=paper,imazu,1", "--markdown"])
    title, _, head, _, *rows = capsys.readouterr().out.splitlines()[:6]
    assert (title, head) == ("Success", "| policy | paper | imazu |")
    assert rows == [
        "| keep_course | 43% (16 to 75) | 0% (0 to 15) |",
        "| vo | 100% (65 to 100) | 100% (85 to 100) |",
    ]
    # One policy, or one suite, needs no second table.
    for words in (["vo", "target=paper,imazu"], ["keep_course", "vo", "target=paper"]):
        main(words)
        assert "Success\n" not in capsys.readouterr().out


def test_a_row_of_each_episode_and_a_sheet_of_their_paths(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files = tmp_path / "all.csv", tmp_path / "all.png"
    failed = ("--failures", str(tmp_path / "failed.png"))
    words = ("--csv", str(files[0]), "--sheet", str(files[1]), *failed)
    scores(capsys, "keep_course", "vo", "target=paper", *words)
    with files[0].open() as file:
        rows = list(csv.DictReader(file))
    assert [row["policy"] for row in rows] == 7 * ["keep_course"] + 7 * ["vo"]
    assert {"suite", "case", "outcome", "encounter", "return", "dcpa", "rule_17", "time_ratio"} < set(rows[0])
    third = rows[2]
    assert (third["case"], third["outcome"], third["encounter"]) == ("3", "collision", "give way")
    assert third["rule_16"] == "0" and third["rule_17"] == third["path_ratio"] == third["dcpa"] == ""
    scores(capsys, "vo", "target=paper", "--sheet", str(tmp_path / "one.png"))
    with Image.open(files[1]) as both, Image.open(tmp_path / "one.png") as one:
        # A second row of pictures, and a line for the policy below each.
        assert both.width == one.width and both.height > 1.5 * one.height
    (tmp_path / "one.png").unlink()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["all.csv", "all.png", "failed.png"]
    (tmp_path / "failed.png").unlink()
    main(["keep_course", "target=1", *failed])
    assert "nothing failed" in capsys.readouterr().out and not (tmp_path / "failed.png").exists()


def test_the_table_of_the_rules_counts_the_ships_of_the_csv_file(tmp_path: Path) -> None:
    words = ("keep_course", "vo", "target=imazu,paper", "--rules", "--markdown", "--csv", "all.csv")
    lines = ship_trl(*words, verb="evaluate", folder=tmp_path).stdout.splitlines()
    table = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines if line.startswith("| ")]
    # Success comes before it, the scores after it.
    assert table[0] == ["policy", "imazu", "paper"]
    table = table[4:]
    end = next(k for k, row in enumerate(table) if "R8" in row)
    assert table[end][0] == "suite" and len(table[end:]) == 2 + 4
    rows = [dict(zip(table[0], row, strict=True)) for row in table[2:end]]
    assert len(rows) == 4 * 6
    with (tmp_path / "all.csv").open() as file:
        episodes = list(csv.DictReader(file))
    for row in rows:
        own = [one for one in episodes if [one["suite"], one["policy"]] == [row["suite"], row["policy"]]]
        ships = [
            {name: one[f"ship_{k}_{name}"] for name in ("encounter", "side", "turn", "bow_crossing", "obeys")}
            for one in own
            for k in (1, 2, 3)
            if one[f"ship_{k}_encounter"]
        ]
        is_all = row["encounter"] == "all"
        engaged = [
            one
            for one in ships
            if one["encounter"] == row["encounter"] or (is_all and one["encounter"] != "none")
        ]
        assert row["engaged"] == f"{len(engaged)} ({len(engaged) / len(ships):.0%})"
        asked = [one["obeys"] == "1" for one in engaged if one["obeys"]]
        obeys = f"{sum(asked) / len(asked):.0%}" if asked else ""
        assert row["obeys"] == (f"{obeys} of {len(asked)}" if is_all else obeys)
        assert len(asked) == len(engaged) or is_all or row["encounter"] not in ("head-on", "give way")
        for one in engaged:
            is_right = one["side"] == "starboard" and float(one["turn"]) >= 10 and one["bow_crossing"] == "0"
            assert one["obeys"] in ("", str(int(is_right)))


def test_a_run_is_a_policy(trained: Path, tmp_path: Path) -> None:
    policy = load_policy(trained)
    assert policy.name == str(trained) and policy.observation == "pixels"
    assert policy.predict(np.zeros((2, 84, 84, 1), np.uint8))[0].shape == (2,)
    with pytest.raises(ConfigError, match=r"policy: no result\.json with its networks at or below"):
        load_policy(tmp_path)


def test_a_result_folder_is_what_it_claims(trained: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = table(capsys, str(trained))
    assert [row[1] for row in rows] == ["2 scratch seed 0, best", "2 scratch seed 0, final"]
    assert all(row[0] == "2" and row[2] == row[-1] for row in rows)
    network = trained / "2" / "scratch" / "seed=0" / "policy.safetensors"
    assert table(capsys, str(network), "target=2")[0][2] == rows[0][2]
    # On another case nothing is claimed.
    assert table(capsys, str(trained), "target=1")[0][-1] == ""


def test_a_folder_that_claims_more_is_refused(trained: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = trained / "2" / "scratch" / "seed=0" / "result.json"
    whole = path.read_text()
    try:
        claims = json.loads(whole)
        claims["best"]["return"] += 1.0
        path.write_text(json.dumps(claims))
        error = refused(capsys, main, str(trained))
        assert "1 of 2 do not reach the return that they claim: 2 scratch seed 0, best" in error
    finally:
        path.write_text(whole)


def test_a_damaged_network_does_not_stop_the_others(
    trained: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = tmp_path / "runs"
    shutil.copytree(trained, copy)
    network = copy / "2" / "scratch" / "seed=0" / "policy.safetensors"
    network.write_bytes(network.read_bytes()[:1000])
    with pytest.raises(SystemExit) as left:
        main([str(copy), "--markdown"])
    printed = capsys.readouterr()
    assert left.value.code == 1 and "2 scratch seed 0, final" in printed.out and "best |" not in printed.out
    first, last = printed.err.splitlines()
    assert str(network) in first and first.endswith("; left out")
    assert last.endswith(
        "1 of 2 do not reach the return that they claim: 2 scratch seed 0, best cannot be read"
    )
    # One that was named must be right.
    assert str(network) in refused(capsys, main, str(network), "random", "target=2")


OWN = """
import torch

def always(env, seed):
    def policy(step):
        return step.set("action", torch.full(env.batch_size, 3))
    return policy

def looking(env, seed):
    def policy(step):
        assert step["pixels"].shape == (*env.batch_size, 1, 84, 84)
        return step.set("action", step["pixels"].flatten(1).sum(-1) % 7)
    return policy
"""


def test_an_own_policy_is_evaluated(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "own.py"
    file.write_text(OWN)
    rows = table(capsys, f"{file}:always", f"{file}:looking", "keep_course", "target=2")
    assert rows[0][2:] == rows[2][2:] and rows[1][2:] != rows[2][2:]


@pytest.mark.parametrize(
    ("number", "said"),
    [
        ("3.0", "writes action float32 [1]; allowed: int64"),
        ("7", "writes action [7]; allowed: int64 [1] from 0"),
    ],
)
def test_an_invalid_action_is_refused(
    number: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "own.py"
    file.write_text(OWN.replace("3)", f"{number})"))
    assert f"policy: {file}:always {said}" in refused(capsys, main, f"{file}:always", "target=2")


# Policies that no contract fits, or that fail.
MINE = """
import torch

def policy(obs):
    return 3

def failing(env, seed):
    return lambda step: step.set("action", step["wind"])
"""


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("random", "target: none given for random"),
        ("nobody", "policy: no nobody; allowed: a result folder, random, keep_course"),
        (
            "nobody target=2",
            f"policy: no nobody; allowed: a result folder, {', '.join(POLICIES)}, pretrained, a",
        ),
        ("random seed=3 target=2", "seed: unknown key; allowed here: target, perturbation.KEY, world"),
        (
            "random target=2 perturbation.speed=1",
            "perturbation.speed: unknown key; allowed here: own_position",
        ),
        ("pretrained:9 target=paper", "policy: no bundled network of case 9; allowed: 1, "),
        ("random target=paper --demonstrations d", "--demonstrations: of single cases, not perturbed"),
        ("vo target=imazu --episodes 2200", "--episodes: all would be the same; allowed: drawn starts"),
        ("random target=2 target=4", "target: given twice"),
        ("nothing.py:policy target=2", "policy: nothing.py:policy returns None; allowed: a function"),
        (
            "mine.py:policy target=2",
            "policy: mine.py:policy is policy(obs); allowed: def policy(env, seed)",
        ),
        (
            "mine.py:failing target=2",
            'policy: mine.py:failing fails: KeyError: \'key "wind" not found in TensorDict',
        ),
        ("vo target=2 world.turn_time=[", "world.turn_time: not readable: "),
    ],
)
def test_wrong_input_is_refused(
    words: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "nothing.py").write_text("policy = lambda *_: None\n")
    (tmp_path / "mine.py").write_text(MINE)
    assert said in refused(capsys, main, *words.split())
