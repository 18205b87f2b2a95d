"""`python -m tests.fuzz.guided`: Atheris over the readers; inputs that reach new code are changed further.

Nothing of the package is imported at the top: Atheris follows what is imported after it.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import re
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from pathlib import Path
from random import Random

from rich.console import Console
from rich.table import Table

# Modules whose branches guide the search: ours, and those in Python that parse for us.
INSTRUMENTED = ("ship_trl", "yaml", "omegaconf", "json")
# Counts are written so often, as the fuzzer ends its process itself.
EVERY = 200
READERS = ("case", "result", "manifest", "curve", "demonstration", "checkpoint")
NOTES = "notes.json"


def child(name: str, seconds: int, number: int, place: Path) -> None:
    """Fuzz one reader in this process, which libFuzzer ends; figures are written to `place`."""
    import atheris

    with atheris.instrument_imports(include=list(INSTRUMENTED), enable_loader_override=False):
        from tests.fuzz import readers
        from tests.fuzz.changes import change

    reader, folder = readers.READERS[name], place / "work"
    counts: Counter[str] = Counter()
    faults: dict[str, list[str]] = {}
    started, told = time.monotonic(), 0

    def note() -> None:
        (place / NOTES).write_text(json.dumps({"counts": counts, "faults": faults}))

    def one(content: bytes) -> None:
        nonlocal told
        try:
            counts["read" if readers.give(reader, content, folder) else "refused"] += 1
        except Exception as error:
            frame = traceback.extract_tb(error.__traceback__)[-1]
            sort = f"{type(error).__name__} at {Path(frame.filename).name}:{frame.lineno}"
            counts["crashed"] += 1
            if sort not in faults or len(repr(content)) < len(faults[sort][1]):
                faults[sort] = [str(error)[:300], repr(content)]
        total = counts.total()
        if total - told >= EVERY or time.monotonic() - started > seconds - 2:
            told = total
            note()

    folder.mkdir()
    (place / "corpus").mkdir()
    (place / "corpus" / "good").write_bytes(reader.good)
    words = sorted(set(re.findall(rb"[\w.]{2,}|[^\w\s]{1,3}", reader.good)))
    escaped = [
        "".join(f"\\x{byte:02x}" for byte in word) for word in [*words, b"NaN", b"1e999", b"null", b"9" * 30]
    ]
    (place / "words").write_text("".join(f'"{word}"\n' for word in escaped))
    flags = [f"-max_total_time={seconds}", f"-seed={number + 1}", f"-dict={place / 'words'}", "-max_len=4096"]
    flags += ["-print_final_stats=1", "-rss_limit_mb=4096", "-timeout=20", f"-artifact_prefix={place}/"]

    def mutate(content: bytes, most: int, drawn: int) -> bytes:
        # Bytes that are changed blindly are no JSON any more most of the time.
        changed = change(content, Random(drawn)) if drawn % 2 else None
        return bytes(atheris.Mutate(content, most)) if changed is None or len(changed) > most else changed

    atheris.Setup([sys.argv[0], *flags, str(place / "corpus")], one, custom_mutator=mutate)
    atheris.Fuzz()


def guided(name: str, seconds: int, number: int, table: Table, console: Console) -> int:
    """Fuzz a reader in a process of its own, a row of the table; returns how many inputs crashed it."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        words = ["--child", str(place), "--reader", name, "--seconds", str(seconds), "--seed", str(number)]
        line = [sys.executable, "-m", "tests.fuzz.guided", *words]
        done = subprocess.run(line, capture_output=True, text=True, check=False, env=os.environ)
        notes = place / NOTES
        if not notes.is_file():
            raise SystemExit(f"{name}: the fuzzer did not start: {done.stderr[-600:]}")
        found = json.loads(notes.read_text())
    covered = re.findall(r"cov: (\d+) ft: (\d+) corp: (\d+)", done.stderr)
    cov, features, corpus = covered[-1] if covered else ("?", "?", "?")
    executed = re.findall(r"stat::number_of_executed_units: (\d+)", done.stderr)
    counts, crashed = found["counts"], found["counts"].get("crashed", 0)
    if done.returncode:  # libFuzzer itself stopped: too slow, or too much memory
        crashed += 1
        console.print(f"{name}: {done.stderr[-600:]}", markup=False, soft_wrap=True)
    for sort, (said, content) in found["faults"].items():
        console.print(f"{name}: {sort}\n    {said}\n    {content[:500]}", markup=False, soft_wrap=True)
    row = [executed[-1] if executed else "?", counts.get("read", 0), counts.get("refused", 0), crashed]
    table.add_row(name, *map(str, row), cov, features, corpus)
    return int(crashed)


def main() -> None:
    """Fuzz the readers one after the other; exit code 1 where one crashed."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz.guided", description=__doc__)
    parser.add_argument("--seconds", type=int, default=600, help="of all readers together (default 600)")
    parser.add_argument("--seed", type=int, default=0, help="of the fuzzer (default 0)")
    parser.add_argument("--reader", choices=READERS, help="only this one")
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if importlib.util.find_spec("atheris") is None:
        parser.exit(1, "atheris is not installed; the extra `fuzz` brings it\n")
    if options.child is not None:
        child(options.reader, options.seconds, options.seed, options.child)
        return
    chosen = [options.reader] if options.reader else list(READERS)
    table, console = Table("reader"), Console(width=120, highlight=False)
    for name in ("executions", "read", "refused", "crashed", "branches", "features", "corpus"):
        table.add_column(name, justify="right")
    share = max(5, options.seconds // len(chosen))
    crashed = sum(guided(name, share, options.seed, table, console) for name in chosen)
    console.print(table)
    sys.exit(1 if crashed else 0)


if __name__ == "__main__":
    main()
