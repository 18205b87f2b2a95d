"""Arguments of verbs: each way of parsing refuses a wrong value in one line."""

from importlib import import_module

import pytest

from ship_trl.cli.parser import add_output, add_policies, add_seed, add_size, make_parser


@pytest.mark.parametrize("words", [["--seed", "x"], ["--size", "1x1"], ["--output", "film.doc"]])
@pytest.mark.parametrize(
    "way", ["parse_args", "parse_known_args", "parse_intermixed_args", "parse_known_intermixed_args"]
)
def test_a_wrong_value_ends_in_one_line(
    way: str, words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    parser = make_parser("verb", None)
    add_policies(parser)
    add_seed(parser)
    add_size(parser, "1280x720", "of the film")
    add_output(parser, "--output", (".gif",), "film")
    with pytest.raises(SystemExit) as ended:
        getattr(parser, way)(["random", *words])
    (line,) = capsys.readouterr().err.splitlines()
    assert ended.value.code == 1 and line.startswith(f"ship_trl: {words[0]}: must be ")


@pytest.mark.parametrize(
    ("verb", "words"),
    [
        ("evaluate", ["random", "--episodes", "0"]),
        ("record", ["random", "--size", "9x9"]),
        ("watch", ["--seed", "-1"]),
    ],
)
def test_verbs_with_words_between_options_refuse_it_too(
    verb: str, words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        import_module(f"ship_trl.cli.{verb}").main(words)
    (line,) = capsys.readouterr().err.splitlines()
    assert ended.value.code == 1 and line.startswith(f"ship_trl: {words[-2]}: must be ")
