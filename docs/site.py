"""Give MkDocs the pages of the repository where they lie, lessons, and an API reference.

The site has the folders of the checkout, so a relative link that GitHub follows is followed there too. A page
that README or docs/ link to is part of it, without a list to keep: the order of the menu is that of README.
"""

from __future__ import annotations

import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
LINK = re.compile(r"\]\(([^)#:]+)(?:#[^)]*)?\)|<(?:img|source)[^>]*?src(?:set)?=\"([^\":]+)\"")
LESSONS = "examples/lessons"
# Rooms of the package that programs import; `""` is what `import ship_trl` offers.
ROOMS = ("", "gym", "sim", "policies", "learn", "transfer", "view", "run", "study", "config")
CELL = re.compile(r"^# %%(.*)$", re.MULTILINE)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Replace the files of docs/ by linked files of the checkout, lessons and API pages; make the menu."""
    for file in [one for one in files if one.src_dir == config.docs_dir]:
        files.remove(file)
    found = linked([README], sorted((ROOT / "docs").glob("*.md")))
    for path in [*found, *(ROOT / LESSONS).glob("pictures/*"), ROOT / "docs/site.css"]:
        files.append(File(name_of(path), str(ROOT), config.site_dir, config.use_directory_urls))
    lessons = {f"{LESSONS}/{path.stem}.md": path for path in sorted((ROOT / LESSONS).glob("*.py"))}
    rooms = {f"api/{room or 'ship_trl'}.md": room for room in ROOMS}
    made = {name: to_markdown(path) for name, path in lessons.items()}
    made |= {name: reference(room) for name, room in rooms.items()}
    for name, content in made.items():
        files.append(File.generated(config, name, content=content))
    pages = [name_of(path) for path in found if path.suffix == ".md" and path != README]
    guide, project = ([name for name in pages if is_in(name)] for is_in in (is_guide, is_project))
    config.nav = [
        {"Home": name_of(README)},
        {"Lessons": [*lessons]},
        {"Guide": guide},
        {"Studies": [name for name in pages if name not in (*guide, *project)]},
        {"API": [{module(room): name} for name, room in rooms.items()]},
        {"Project": project},
    ]
    return files


def on_page_markdown(markdown: str, *, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Let links to a lesson's program lead to its page."""
    del page, config, files
    for path in (ROOT / LESSONS).glob("*.py"):
        markdown = markdown.replace(f"{path.name})", f"{path.stem}.md)")
    return markdown


def name_of(path: Path) -> str:
    """Return a file's path from the top of the checkout."""
    return path.relative_to(ROOT).as_posix()


def is_guide(name: str) -> bool:
    """Return whether a page lies in docs/."""
    return name.startswith("docs/")


def is_project(name: str) -> bool:
    """Return whether a page lies at the top of the checkout."""
    return "/" not in name


def linked(first: list[Path], then: list[Path]) -> list[Path]:
    """Return pages and all files that they link to: `first` and where they lead, then the rest of `then`."""
    found: dict[Path, None] = {}
    for left in (list(first), list(then)):
        while left:
            path = left.pop(0)
            if path in found or not path.is_file() or path.parent == ROOT / LESSONS:
                continue
            found[path] = None
            if path.suffix == ".md":
                links = [one or other for one, other in LINK.findall(path.read_text())]
                left += [(path.parent / link).resolve() for link in links]
    return list(found)


def to_markdown(program: Path) -> str:
    """Turn a percent script into a page: comments of `[markdown]` cells are text, all else is code."""
    head, *cells = CELL.split(program.read_text())
    assert not head.strip(), f"{program}: text before the first cell"
    parts = []
    for kind, cell in zip(cells[::2], cells[1::2], strict=True):
        if kind.strip() == "[markdown]":
            parts.append(re.sub(r"^# ?", "", cell.strip("\n"), flags=re.MULTILINE))
        else:
            parts.append(f"```python\n{cell.strip()}\n```")
    return "\n\n".join(parts) + "\n"


def module(room: str) -> str:
    """Return the name by which programs import a room of the package."""
    return f"ship_trl.{room}".rstrip(".")


def reference(room: str) -> str:
    """Return the page of a room of the package: its public modules, by their docstrings."""
    name = module(room)
    folder = ROOT / "ship_trl" / room
    modules = sorted(folder.glob("[!_]*.py")) if room and folder.is_dir() else []
    below = [f"::: {name}.{path.stem}\n" for path in modules]
    return "\n".join([f"::: {name}\n    options:\n      heading_level: 1\n", *below])
