"""Printed commands come back from a real shell and from Hydra's parser as they were meant."""

from pathlib import Path

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser
from hypothesis import example, given
from hypothesis import strategies as st

from ship_trl.config import errors
from ship_trl.config.errors import command, missing_extra, override
from tests.pasted import ODD, pasted

words = st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"]), min_size=1, max_size=12)


def hydra_value(word: str) -> tuple[str, str]:
    """Return key and text of an override, as Hydra reads them."""
    found = OverridesParser.create().parse_override(word)
    return found.key_or_group, str(found.value())


@pytest.mark.parametrize("name", ODD)
def test_odd_names_come_back(name: str) -> None:
    assert hydra_value(override("output", name)) == ("output", name)
    assert pasted(command("watch", name)) == ["watch", name]


@given(words)
@example("\\")
@example("a\\'b\\\\'")
@example("'\\\\")
@example("inF")
@example(".5")
def test_any_text_comes_back_from_hydra(text: str) -> None:
    assert hydra_value(override("target", text)) == ("target", text)


@pytest.mark.parametrize("text", ["4", "0", "high", "outputs/quick-2", "/tmp/a.b", "FT3"])
def test_plain_words_are_not_quoted(text: str) -> None:
    assert command("x", override("target", text)) == f"python -m ship_trl x target={text}"


@pytest.mark.parametrize("folder", ["-runs", "target=4", "a.b=4"])
def test_a_path_looks_like_no_flag_and_like_no_key(folder: str) -> None:
    (word,) = pasted(command(Path(folder)))
    assert word[0] == "." and Path(word) == Path(folder)


def test_an_extra_is_installed_from_the_checkout_or_for_the_wheel(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert missing_extra("onnx", "onnx").endswith("; run: pip install -e '.[onnx]'")
    monkeypatch.setattr(errors, "PACKAGE", tmp_path / "ship_trl")
    assert missing_extra("onnx", "onnx").endswith("; run: pip install 'ship_trl[onnx]'")
