"""Single values, right and hostile: numbers, texts and words, and trees of them."""

from __future__ import annotations

import math
from typing import Any

from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

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
