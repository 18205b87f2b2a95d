"""What people type and programs write into files: right, nearly right, and hostile."""

from __future__ import annotations

import math
from typing import Any

from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from ship_trl.architecture import load_network
from ship_trl.config import plain
from ship_trl.paths import conf_dir
from ship_trl.sim.cases import load_world
from tests.fuzz.judge import CONFIG_KEYS

# As a shell hands them over: numbers out of range, words of YAML, of Hydra's grammar and of OmegaConf.
WORDS = (
    *(
        "",
        "nan",
        ".nan",
        "inf",
        "-inf",
        ".inf",
        "1e400",
        "-1e400",
        "1e308",
        "-1e308",
        "1e39",
        "1e-39",
        "1e-320",
    ),
    *("0", "-1", "-0.0", "0.5", "1.5", "007", "0x10", "1_000", "1:30", "2001-01-01", "9" * 30, "9" * 400),
    *("9" * 5000, "1" + "0" * 12, "1000000000", "4294967296", "9223372036854775808", "true", "false", "yes"),
    *("null", "~", "None", "[]", "{}", "[1]", "[[1]]", "[[]]", "{a:1}", "[1,2]", "[[1,2]]", "[[nan,0]]"),
    *("[null]", "[[null]]", "[a,b]", "[{a:1}]", "[" * 50, "[" * 40 + "]" * 40, "''", "'a b'", '"', "'", '""'),
    *(
        "\u00fc",
        "\u65e5\u672c",
        "\u202e",
        "\u2028",
        "a\nb",
        "a\tb",
        "a\x1b[31mb",
        "\ud800",
        "\x85",
        "\U0001f6a2",
    ),
    *(
        "${oc.env:HOME}",
        "${oc.env:NOWHERE}",
        "${oc.env:NOWHERE,3}",
        "${nothing}",
        "${output}",
        "${case_base}",
    ),
    *("${pair}", "${learn}", "${world.actions}", "${seed}", "${oc.decode:'[1,2]'}", "${oc.create:{}}", "${"),
    *(
        "${}",
        "${a",
        "${.}",
        "${..}",
        "${oc.dict.keys:learn}",
        "${hydra:runtime.cwd}",
        "???",
        "$",
        "\\",
        "\\\\",
    ),
    *(
        "a=b",
        "a,b",
        "1,2",
        "choice(1,2)",
        "range(1,3)",
        "range(0,1e9)",
        "glob(*)",
        "sort(1,2)",
        "int(3)",
        "float(x)",
    ),
    *("str(", "json_str(1)", "@", "..", ".", "/", "/dev/null", "/dev/zero", "/proc/self/mem", "a" * 300),
    *(
        "a/" * 3000,
        "cuda",
        "cuda:0",
        "cuda:x",
        "cuda:-1",
        "cuda:" + "9" * 30,
        "cpu:0",
        "pretrained",
        "all",
        "-",
        "+",
    ),
)
# Values that are right somewhere.
FAIR = (
    "1",
    "2",
    "3",
    "4",
    "paper",
    "quick",
    "smoke",
    "scratch",
    "finetune",
    "random",
    "learned",
    "0.1",
    "10",
    "100",
)
LINES = (
    ("+pair=high", "layers=3"),
    ("target=1", "method=scratch"),
    ("source=3", "target=2", "method=feature_extraction", "layers=2"),
)
GROUPS = tuple(sorted(path.name for path in conf_dir().iterdir() if path.is_dir()))
STRANGE_KEYS = (
    *(
        "",
        ".",
        "a.b",
        "learn.",
        ".learn",
        "learn..lr",
        "hydra.run.dir",
        "hydra.mode",
        "hydra",
        "hydra/launcher",
    ),
    *(
        "hydra/sweeper",
        "hydra.sweeper.params",
        "world@learn",
        "learn@_global_",
        "hydra/job_logging",
        "_target_",
    ),
    *(
        "defaults",
        "world.actions.0",
        "world.actions[0]",
        "network.conv.0",
        "layers.a",
        "\u00fc",
        "a b",
        "seed ",
        " seed",
    ),
    *("${seed}", "'seed'", "package", "_global_", "learn/paper", "a" * 300),
)

finite = st.floats(allow_nan=False, allow_infinity=False)
any_float = st.one_of(st.floats(), st.sampled_from([1e308, -1e308, 1e-300, 1e39, 3e38, 0.0, -0.0, 1e9]))
any_int = st.one_of(
    st.integers(-3, 300), st.sampled_from([10**9, 10**12, 2**31, 2**63, 2**64, 10**30, 10**400])
)
texts = st.text(st.characters(codec=None, exclude_characters="\x00"), max_size=12)
scalars: SearchStrategy[Any] = st.one_of(
    st.none(), st.booleans(), any_int, any_float, texts, st.sampled_from(WORDS + FAIR)
)
trees = st.recursive(
    scalars,
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(texts, inner, max_size=3)),
    max_leaves=8,
)


def magnitude(low: float, high: float) -> SearchStrategy[float]:
    """Draw numbers whose logarithm is even between two bounds."""
    return st.floats(math.log10(low), math.log10(high)).map(lambda power: float(10**power))


def mostly(usual: SearchStrategy[Any], odd: SearchStrategy[Any], of: int = 12) -> SearchStrategy[Any]:
    """Draw the odd ones once in so many times; `one_of` knows no weights."""
    return st.integers(1, of).flatmap(lambda n: odd if n == of else usual)


# One override, as it is typed.
typed_words = st.one_of(
    st.sampled_from(WORDS),
    st.sampled_from(FAIR),
    texts,
    any_int.map(str),
    any_float.map(repr),
    magnitude(1e-4, 1e4).map(repr),
    st.integers(0, 2000).map(str),
)
keys = st.one_of(
    st.sampled_from(sorted(CONFIG_KEYS)), st.sampled_from(STRANGE_KEYS), st.sampled_from(GROUPS), texts
)


@st.composite
def overrides(draw: st.DrawFn) -> list[str]:
    """A command line: one that is right, and one to three more words."""
    line = list(draw(st.sampled_from(LINES)))
    for _ in range(draw(st.integers(1, 3))):
        sign = draw(st.sampled_from(["", "", "", "", "+", "++", "~"]))
        word = f"{sign}{draw(keys)}={draw(typed_words)}"
        line.append(draw(st.sampled_from([word, word, word, word, word, word.partition("=")[0]])))
    return line


study_lines = st.lists(
    st.one_of(
        st.builds(
            "{}={}".format,
            st.sampled_from(
                [
                    *(
                        "profile",
                        "seeds",
                        "first_seed",
                        "block",
                        "profile_seeds",
                        "profile_seeds.quick",
                        "pairs",
                    ),
                    *("arms", "reuse", "controls", "output", "launcher", "processes", "retries", "overrides"),
                    *("logger", "wandb", "wandb.mode", "wandb.project", "sseds", "pairs.0", "pairs[0]", ""),
                ]
            ),
            st.one_of(
                typed_words,
                st.sampled_from(
                    [
                        *(
                            "smoke",
                            "[high]",
                            "[high,low]",
                            "[scratch,FTW]",
                            "2",
                            "5",
                            "joblib",
                            "ray_local",
                            "false",
                        ),
                        *(
                            "[learn.lr=1e-3]",
                            "[seed=1]",
                            "[learn.lr]",
                            "['learn.lr=[']",
                            "[learn.lr=1e400]",
                            "[=]",
                        ),
                    ]
                ),
            ),
        ),
        texts,
    ),
    min_size=1,
    max_size=3,
)

WORLD = plain(load_world())
NETWORK = plain(load_network())


def leaves(values: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """List the places of a tree's leaves and branches."""
    found = [path] if path else []
    if isinstance(values, dict):
        for key, value in values.items():
            found += leaves(value, (*path, key))
    elif isinstance(values, list):
        for index, value in enumerate(values):
            found += leaves(value, (*path, index))
    return found


def put(values: Any, path: tuple[Any, ...], value: Any) -> Any:
    """Copy a tree with one place changed."""
    if not path:
        return value
    copied: Any = dict(values) if isinstance(values, dict) else list(values)
    copied[path[0]] = put(values[path[0]], path[1:], value)
    return copied


@st.composite
def damaged(draw: st.DrawFn, good: Any, most: int = 3) -> Any:
    """A tree with up to so many places replaced, scaled, taken out, or put in under a wrong name."""
    values = good
    for _ in range(draw(st.integers(1, most))):
        places = leaves(values)
        if not places:
            break
        path = draw(st.sampled_from(places))
        match draw(st.sampled_from(["scale", "scale", "scalar", "scalar", "tree", "take", "add"])):
            case "scale":
                old = at(values, path)
                number = type(old) is float or (type(old) is int and abs(old) < 10**12)
                values = put(values, path, draw(magnitude(1e-9, 1e9)) * old if number else draw(scalars))
            case "scalar":
                values = put(values, path, draw(scalars))
            case "tree":
                values = put(values, path, draw(trees))
            case "take":
                above = at(values, path[:-1])
                kept = (
                    {k: v for k, v in above.items() if k != path[-1]}
                    if isinstance(above, dict)
                    else [v for n, v in enumerate(above) if n != path[-1]]
                )
                values = put(values, path[:-1], kept)
            case "add":
                above = at(values, path[:-1])
                more = (
                    {**above, draw(texts): draw(scalars)}
                    if isinstance(above, dict)
                    else [*above, draw(scalars)]
                )
                values = put(values, path[:-1], more)
    return values


def at(values: Any, path: tuple[Any, ...]) -> Any:
    """Find what stands at a place."""
    for key in path:
        values = values[key]
    return values


@st.composite
def worlds(draw: st.DrawFn) -> dict[str, Any]:
    """A world of any size, some beyond what numbers can hold."""
    wide = st.one_of(magnitude(1e-4, 1e4), magnitude(1e-4, 1e4), magnitude(1e-40, 1e40), any_float)
    near = magnitude(0.3, 3)
    speed, turn = st.floats(-30, 30), st.floats(-1, 1)
    odd = st.tuples(st.one_of(speed, wide), st.one_of(turn, wide))
    action = mostly(st.tuples(speed, turn), odd, 60).map(list)
    world = WORLD | {
        "dt": draw(mostly(near, wide)),
        "max_steps": draw(mostly(st.integers(60, 300), st.one_of(st.integers(-2, 1200), any_int))),
        "safe_distance": draw(mostly(near.map(lambda x: x * 45), wide)),
        "goal_distance": draw(mostly(near.map(lambda x: x * 60), wide)),
        "actions": draw(
            mostly(
                st.one_of(st.just(WORLD["actions"]), st.lists(action, min_size=1, max_size=12)),
                st.integers(1, 300).map(lambda n: [[15.0, 0.0]] * n),
            )
        ),
        "reward": {key: draw(mostly(st.just(value), wide, 60)) for key, value in WORLD["reward"].items()},
    }
    return draw(mostly(st.just(world), damaged(world), 4))


@st.composite
def networks(draw: st.DrawFn) -> dict[str, Any]:
    """Layers that fit on one another, most of them small, or not."""
    side, conv = 84, []
    sizes = mostly(st.integers(1, 12), st.sampled_from([200, 4096, 5000, 10**9]), 20)
    for _ in range(draw(mostly(st.integers(0, 4), st.sampled_from([40, 400]), 20))):
        kernel = draw(st.integers(1, min(side, 12)))
        stride = draw(st.integers(1, 5))
        conv.append([draw(sizes), kernel, stride])
        side = (side - kernel) // stride + 1
    conv.append([draw(sizes), side, 1])
    network = {"conv": conv, "hidden": draw(sizes)}
    return draw(mostly(st.just(network), damaged(network), 4))


any_big = mostly(
    st.one_of(st.integers(1, 1000), magnitude(1, 1e7).map(int)),
    st.one_of(any_int, magnitude(1, 1e13).map(int)),
    6,
)
# Settings of the learner that decide how much a run holds in memory, and how large its numbers grow.
SIZES = dict.fromkeys(
    (
        *("episodes", "num_envs", "batch_size", "replay_size", "warmup_steps", "update_every"),
        *("evaluate_every", "jumpstart_draws"),
    ),
    any_big,
)
RATES = {
    key: mostly(magnitude(1e-6, 1.0), any_float, 6)
    for key in (
        *("gamma", "lr", "lr_end", "tau", "huber_delta", "reward_scale"),
        *("epsilon_start", "epsilon_end", "epsilon_fraction"),
    )
}
WORDED = {
    "loss": st.sampled_from(["l2", "huber", "l3"]),
    "backend": st.sampled_from(["auto", "incremental", "dense"]),
}


@st.composite
def learners(draw: st.DrawFn) -> dict[str, Any]:
    """One to four settings of the learner."""
    known = SIZES | RATES | WORDED
    chosen = draw(st.lists(st.sampled_from(sorted(known)), min_size=1, max_size=4, unique=True))
    return {key: draw(known[key]) for key in chosen}
