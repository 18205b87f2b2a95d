"""Command lines as people type them: right, nearly right, and hostile."""

from __future__ import annotations

from hypothesis import strategies as st

from ship_trl.config.paths import conf_dir
from tests.fuzz.judge import CONFIG_KEYS
from tests.fuzz.values import FAIR, WORDS, any_float, any_int, magnitude, texts

LINES = (
    ("+pair=high", "layers=3"),
    ("target=1", "method=scratch"),
    ("source=3", "target=2", "method=feature_extraction", "layers=2"),
)
GROUPS = tuple(sorted(path.name for path in conf_dir().iterdir() if path.is_dir()))
# Overrides that are right by themselves; not all are beside one another.
RIGHT = (
    *(
        "seed=7",
        "colour=true",
        "layers=2",
        "method=finetune",
        "profile=quick",
        "network=paper",
        "overwrite=true",
    ),
    *("learn.gamma=0.5", "learn.lr=1e-3", "learn.episodes=50", "learn.batch_size=8", "learn.loss=huber"),
    *("world.max_steps=90", "world.dt=0.5", "world.safe_distance=40", "checkpoint.every=0.5", "logger=csv"),
)
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
    """A command line: one that is right, and one to three more words, each right in one of two cases."""
    line = list(draw(st.sampled_from(LINES)))
    for _ in range(draw(st.integers(1, 3))):
        if draw(st.booleans()):
            line.append(draw(st.sampled_from(RIGHT)))
            continue
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
