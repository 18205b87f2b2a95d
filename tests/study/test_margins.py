"""What is read from the file of margins, and what is refused."""

from pathlib import Path

import pytest

from ship_trl.config.errors import ConfigError
from ship_trl.config.paths import conf_dir
from ship_trl.study.margins import margin, read_margins
from ship_trl.study.plan import NEW_CASE, options, read_option


def test_the_shipped_file_is_right() -> None:
    shipped = read_margins(conf_dir() / "analysis.yaml")
    assert shipped.margin == 0.2
    targets = {str(read_option("pair", pair)["target"]) for pair in options("pair")} | {NEW_CASE}
    assert set(shipped.gains) == targets and all("area" in gain for gain in shipped.gains.values())


def test_a_margin_is_a_share_of_the_gain_and_unknown_without_one(gains: dict[str, dict[str, float]]) -> None:
    assert margin("2", "area") == pytest.approx(0.2 * gains["2"]["area"])
    assert margin("2", "least distance") is margin("mine", "area") is None


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("gains: {}", "analysis.yaml: margin: missing; a value is needed"),
        ("margin: 0", "analysis.yaml: margin: must be above 0, got 0"),
        ("margin: wide", "analysis.yaml: margin: must be a finite number, got wide"),
        ("margin: .nan", "analysis.yaml: margin: must be a finite number, got nan"),
        ("margins: 0.2", "analysis.yaml: margins: unknown key; allowed here: margin, gains"),
        ('{margin: 0.2, gains: {"2": {area: -1.0}}}', "analysis.yaml: gains.2.area: must be above 0, got -1"),
        (
            '{margin: 0.2, gains: {"2": {volume: 1.0}}}',
            "analysis.yaml: gains.2: must be gains of area, time",
        ),
        ("{margin: 0.2", "analysis.yaml: cannot be read: "),
    ],
)
def test_what_is_wrong_is_one_line(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "analysis.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        read_margins(path)
    assert str(caught.value).startswith(said) and "\n" not in str(caught.value)
