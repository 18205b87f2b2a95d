"""A user's functions are imported and called; what is wrong with them is one line."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from ship_trl.config.errors import ConfigError
from ship_trl.config.imports import import_function
from ship_trl.learn.algorithm import build_algorithm


def test_a_function_must_take_what_it_is_given() -> None:
    Path("mine.py").write_text("def build(one, two=2): return one\ndef more(*all): pass\nnumber = 3\n")
    assert import_function("mine.py:build", "key", "setup")(5) == 5
    import_function("mine.py:more", "key", "env", "seed")
    for name, parameters, said in (
        ("build", ("a", "b", "c"), "is build(one, two=2); allowed: def build(a, b, c)"),
        ("build", (), "is build(one, two=2); allowed: def build()"),
        ("number", (), "mine.py has no function number"),
    ):
        with pytest.raises(ConfigError) as refused:
            import_function(f"mine.py:{name}", "key", *parameters)
        assert said in str(refused.value)


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("def build(): pass", r"mine.py:build is build\(\); allowed: def build\(setup\)$"),
        (
            "def build(s):\n  s.x",
            r"algorithm\.build: mine\.py:build fails: AttributeError: .*no attribute 'x'",
        ),
        ("def build(s):\n\n  1 / 0", r"fails: ZeroDivisionError: division by zero \(mine\.py, line 3\)$"),
        ("1 +", r"algorithm\.build: mine\.py:build cannot be imported: SyntaxError: "),
        ("\n\nnothing", r"cannot be imported: NameError: .*'nothing' is not defined \(mine\.py, line 3\)$"),
    ],
)
def test_an_own_algorithm_that_fails_is_one_line(code: str, said: str) -> None:
    Path("mine.py").write_text(code)
    setup: Any = SimpleNamespace(options={"build": "mine.py:build"})
    with pytest.raises(ConfigError, match=said):
        build_algorithm(setup)
