"""The documents: short, linked, with commands that exist and lines of Python that run."""

import re
from pathlib import Path

import pytest
from PIL import Image

from ship_trl.cli.help import VERBS
from tests.command import ROOT
from tests.forked import run_script

PAGES = [
    *(ROOT / f"{name}.md" for name in ("README", "CHANGELOG", "CONTRIBUTING", "SECURITY")),
    *sorted((ROOT / "docs").glob("*.md")),
]
STUDIES = sorted((ROOT / "studies").rglob("*.md"))
MAX_PAGES, MAX_WORDS, MAX_README_BYTES = 16, 14_000, 5_000
LINK = re.compile(r"\]\(([^)#]*)(?:#([^)]*))?\)")


def anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", [*PAGES, *STUDIES], ids=lambda page: f"{page.parent.name}/{page.name}")
def test_every_link_and_picture_is_there(page: Path) -> None:
    for link, anchor in LINK.findall(page.read_text()):
        if not link.startswith("https://"):
            goal = page.parent / link if link else page
            assert goal.exists(), link
            assert not anchor or anchor in anchors(goal), f"{link}#{anchor}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_file_that_is_named_is_there(page: Path) -> None:
    named = set(re.findall(r"\b(?:ship_trl|tests|conf|examples|docker)/[\w/.-]*\w", page.read_text()))
    yours = {name for name in named if "NAME" in name or name.endswith("/mine.yaml")}
    assert [name for name in sorted(named - yours) if not (ROOT / name).exists()] == []


def test_the_readme_leads_to_every_page_and_a_page_shows_every_picture() -> None:
    leads = {ROOT / link for link, _ in LINK.findall((ROOT / "README.md").read_text())}
    assert leads >= {page for page in PAGES if page.name != "README.md"}
    shown = {(page.parent / link).resolve() for page in PAGES for link, _ in LINK.findall(page.read_text())}
    assert shown >= {picture.resolve() for picture in (ROOT / "docs/pictures").iterdir()}


def test_the_documents_are_short() -> None:
    # Tables that a command writes between its marks are no prose.
    prose = [re.sub(r"<!-- begin:.*?<!-- end -->", "", page.read_text(), flags=re.S) for page in PAGES]
    assert len(PAGES) <= MAX_PAGES and sum(len(text.split()) for text in prose) <= MAX_WORDS
    assert (ROOT / "README.md").stat().st_size <= MAX_README_BYTES


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_command_exists(page: Path) -> None:
    lines = re.findall(
        r"^ *(?:\.venv/bin/)?python -m (ship_trl\S*) ([\w-]+)(?![\w=])", page.read_text(), re.M
    )
    assert {(module, verb) for module, verb in lines if verb not in {"-m", "VERB", *VERBS}} <= {
        ("ship_trl", "--config-dir"),
        ("ship_trl", "--help"),
    }
    assert all(module == "ship_trl" for module, _ in lines)


def test_the_lines_of_python_run(tmp_path: Path) -> None:
    """The block of docs/library.md that begins with our import, as somebody would copy it."""
    lines = (ROOT / "docs/library.md").read_text().partition("\n    import ship_trl\n")[2].splitlines()
    end = next(n for n, line in enumerate(lines) if line and not line.startswith("    "))
    (tmp_path / "outputs").mkdir()
    code = "\n".join(["import ship_trl", *(line.removeprefix("    ") for line in lines[:end])])
    (tmp_path / "block.py").write_text(code)
    ended = run_script(tmp_path / "block.py", folder=tmp_path)
    assert ended.code == 0 and ended.out.startswith("goal "), ended
    with Image.open(tmp_path / "outputs/case4.gif") as film:
        assert film.n_frames > 30  # type: ignore[attr-defined]
    block = (ROOT / "README.md").read_text().partition("```python\n")[2].partition("```")[0]
    (tmp_path / "predict.py").write_text(block)
    ended = run_script(tmp_path / "predict.py", folder=tmp_path)
    assert ended.code == 0 and ended.out.startswith("goal "), ended
