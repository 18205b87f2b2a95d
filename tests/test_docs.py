"""The documents lead somewhere, and the README is short enough to be read."""

import re
from pathlib import Path

import pytest
from PIL import Image

from tests.command import ROOT
from tests.forked import run_script

PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "SECURITY.md")),
    *sorted((ROOT / "docs").glob("*.md")),
]
MOST_BYTES = 10_000


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_and_picture_is_there(page: Path) -> None:
    links = re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", page.read_text())
    for link in links:
        assert link.startswith("https://") or (page.parent / link).exists(), link


def test_the_index_lists_every_page() -> None:
    index = (ROOT / "docs/README.md").read_text()
    assert all(
        f"({page.name})" in index for page in PAGES if page.parent.name == "docs" and page.stem != "README"
    )


def test_the_readme_is_short() -> None:
    assert (ROOT / "README.md").stat().st_size <= MOST_BYTES


@pytest.mark.parametrize("page", ["README.md", "docs/pretrained.md"])
def test_the_lines_of_python_run(page: str, tmp_path: Path) -> None:
    """The block that begins with our import, as somebody would copy it."""
    after = (ROOT / page).read_text().partition("\n    import ship_trl\n")[2]
    lines = ["import ship_trl"]
    for line in after.splitlines():
        if line and not line.startswith("    "):
            break
        lines.append(line.removeprefix("    "))
    (tmp_path / "block.py").write_text("\n".join(lines))
    ended = run_script(tmp_path / "block.py", folder=tmp_path)
    assert ended.code == 0 and ended.out.startswith("goal "), ended
    with Image.open(tmp_path / "case4.gif") as film:
        assert film.n_frames > 30  # type: ignore[attr-defined]
