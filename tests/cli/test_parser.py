"""Arguments of verbs: each way of parsing refuses a wrong value in one line."""

from typing import Annotated

import pytest
from pydantic import Field

from ship_trl.cli.parser import add_number, add_output, add_policies, add_size, make_parser


@pytest.mark.parametrize("words", [["--seed", "x"], ["--size", "1x1"], ["--output", "film.doc"]])
@pytest.mark.parametrize("way", ["parse_args", "parse_intermixed_args"])
def test_a_wrong_value_ends_in_one_line(
    way: str, words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    parser = make_parser("verb", None)
    add_policies(parser, None, "")
    add_size(parser, "1280x720", "of the film")
    add_output(parser, "--output", (".gif",), "film")
    with pytest.raises(SystemExit) as ended:
        getattr(parser, way)(["random", *words])
    (line,) = capsys.readouterr().err.splitlines()
    assert ended.value.code == 1 and line.startswith(f"ship_trl: {words[0]}: must be ")


@pytest.mark.parametrize("text", ["-1e3", "-1000.0", "-.1e4"])
def test_a_negative_number_in_any_form_is_no_option(text: str) -> None:
    parser = make_parser("verb", None)
    parser.add_argument("words", nargs="*")
    add_number(parser, "--low", Annotated[float, Field(ge=-1e9, le=1e9)], None, "")
    found = parser.parse_intermixed_args(["one", "--low", text, "two"])
    assert (found.low, found.words) == (-1000.0, ["one", "two"])
