"""Damage a file: cut it, flip bits, change a value, or put a hostile file in its place.

Each damage takes a path and a random generator, and returns what it did.
"""

import io
import json
import lzma
import os
import pickle
import random
import shutil
import struct
import zipfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import yaml

# A file that exists only if a hostile file was executed.
EXECUTED = "EXECUTED"
# Values that no reader expects.
ODD: tuple[Any, ...] = (
    *(None, True, -1, 0, 1, 2**31, 2**63, 10**400, 1.5, 1e308, -1e308, float("nan"), float("inf")),
    *("", "x", "nan", "1e999", "-1", "0x10", "0" * 5000, "x" * 100_000, "\n\n", "a\x00b", "\ud800", "☃"),
    *("../../../../etc/passwd", "/etc/passwd", "${oc.env:HOME}", "${seed}", "???"),
    *([], {}, [[]], [None], {"": 1}, [1] * 50),
)
LINKS = ("/etc/passwd", "/dev/zero", "/dev/null", "/proc/self/mem", "/", "/nowhere/at/all")
Damage = Callable[[Path, random.Random], str]


def replace(path: Path, data: bytes) -> None:
    """Write a new file in place of another; other links of that one keep its content."""
    path.unlink()
    path.write_bytes(data)


def cut(path: Path, rng: random.Random) -> str:
    """Keep the beginning."""
    data = path.read_bytes()
    size = rng.randrange(len(data)) if data else 0
    replace(path, data[:size])
    return f"cut to {size} bytes"


def flip(path: Path, rng: random.Random) -> str:
    """Flip bits, half of them in the first 2,000 bytes, where a header is."""
    data = bytearray(path.read_bytes())
    places = []
    for _ in range(rng.choice((1, 1, 1, 2, 8, 64))):
        if size := len(data) if rng.random() < 0.5 else min(len(data), 2000):
            places.append(rng.randrange(size))
            data[places[-1]] ^= 1 << rng.randrange(8)
    replace(path, bytes(data))
    return f"bits flipped in bytes {places[:8]}"


def fill(path: Path, rng: random.Random) -> str:
    """Fill with noise, zeros, nothing, or the content twice."""
    data = path.read_bytes()
    size = len(data)
    fills = {"noise": rng.randbytes(size), "zeros": bytes(size), "nothing": b"", "it twice": data * 2}
    kind = rng.choice(sorted(fills))
    replace(path, fills[kind])
    return f"filled with {kind}"


def swap(path: Path, rng: random.Random) -> str:
    """Put a file of another kind in its place."""
    name = rng.choice(sorted(hostile_files()))
    replace(path, hostile_files()[name])
    return f"replaced by {name}"


class Executes:
    """Runs a command when it is unpickled."""

    def __reduce__(self) -> tuple[Any, ...]:
        return os.system, (f"touch {EXECUTED}",)


@cache
def hostile_files() -> dict[str, bytes]:
    """Make files of other kinds, some of which would run something or fill the memory."""
    made = pickle.dumps(Executes())
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("archive/data.pkl", made)
        file.writestr("zeros", bytes(100_000_000))
    levels = [f"l{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]" for n in range(1, 9)]
    headers = {
        "a huge shape": '{"conv1.weight":{"dtype":"F32","shape":[99999999,9999999],"data_offsets":[0,9]}}',
        "offsets beyond the file": '{"a":{"dtype":"F32","shape":[1000000],"data_offsets":[0,4000000]}}',
        "no tensor": '{"__metadata__":{"ship_trl":"[]"}}',
        "a wrong network": '{"__metadata__":{"ship_trl":"{\\"network\\": []}"}}',
        "a deep network": '{"__metadata__":{"ship_trl":"' + "[" * 100_000 + '"}}',
    }
    return {
        "a GIF": b"GIF89aT\x00T\x00\x87\x00\x00" + bytes(500),
        "a pickle": made,
        "a zip bomb": archive.getvalue(),
        "an xz bomb": lzma.compress(bytes(100_000_000), preset=0),
        "YAML tags": f"start: !!python/object/apply:os.system ['touch {EXECUTED}']\n".encode(),
        "YAML aliases": "\n".join(["l0: &a0 [x, x]", *levels]).encode(),
        "a YAML list of itself": b"&a [*a]\n",
        "a deep list": b"[" * 200_000,
        "deep YAML": b"".join(b" " * k + b"a:\n" for k in range(3000)),
        "an empty object": b"{}",
        "a long number": b'{"a": ' + b"9" * 100_000 + b"}",
        "a long CSV line": b"episode," * 500_000,
        "UTF-16": "start: [0, 0]\n".encode("utf-16"),
        "Latin-1": "start: \xe4\xff\n".encode("latin-1"),
        **{f"a header of {n} bytes": struct.pack("<Q", n) + b"{}" * 50 for n in (0, 99_000_000, 1 << 63)},
        **{
            f"{n} in a header": struct.pack("<Q", len(t)) + t.encode() + bytes(64) for n, t in headers.items()
        },
    }


def change_value(path: Path, rng: random.Random) -> str:
    """Change one value of JSON, YAML, CSV, or the header of safetensors; the form stays whole."""
    data = path.read_bytes()
    try:
        if path.suffix == ".json":
            values = json.loads(data)
            what = change_tree(values, rng)
            made = json.dumps(values).encode()
        elif path.suffix == ".yaml":
            values = yaml.safe_load(data)
            what = change_tree(values, rng)
            made = yaml.safe_dump(values, sort_keys=False).encode()
        elif path.suffix == ".csv":
            rows = [line.split(",") for line in data.decode().split("\n")]
            row = rng.choice(rows)
            what = row[rng.randrange(len(row))] = str(rng.choice(ODD))[:10_000]
            made = "\n".join(map(",".join, rows)).encode(errors="replace")
        elif path.suffix == ".safetensors":
            (size,) = struct.unpack("<Q", data[:8])
            header = json.loads(data[8 : 8 + size])
            if rng.random() < 0.5:
                about = json.loads(header["__metadata__"]["ship_trl"])
                what = change_tree(about, rng)
                header["__metadata__"]["ship_trl"] = json.dumps(about)
            else:
                what = change_tree(header, rng)
            text = json.dumps(header).encode()
            made = struct.pack("<Q", len(text)) + text + data[8 + size :]
        else:
            return flip(path, rng)
    except (ValueError, yaml.YAMLError):
        return flip(path, rng)
    replace(path, made)
    return f"changed: {what:.60}"


def change_tree(values: Any, rng: random.Random) -> str:
    """Change, remove or rename one value inside lists and objects."""
    keys = list(values) if isinstance(values, dict) else list(range(len(values)))
    if not keys:
        return "nothing, for it is empty"
    key = rng.choice(keys)
    if isinstance(values[key], dict | list) and values[key] and rng.random() < 0.8:
        return f"{key}.{change_tree(values[key], rng)}"
    how = rng.random()
    if how < 0.1:
        del values[key]
        return f"{key} removed"
    if how < 0.15 and isinstance(values, dict):
        values["odd"] = values.pop(key)
        return f"{key} renamed"
    values[key] = rng.choice(ODD)
    return f"{key} is {str(values[key])[:40]!a}"


def no_file(path: Path, rng: random.Random) -> str:
    """Remove a file or its folder, or put a folder, a pipe or a link in its place."""
    kind = rng.choice(("nothing", "nothing", "no folder", "a folder", "a pipe", "itself", *LINKS))
    path.unlink()
    if kind == "no folder":
        shutil.rmtree(path.parent)
    elif kind == "a folder":
        path.mkdir()
    elif kind == "a pipe":
        os.mkfifo(path)
    elif kind != "nothing":
        path.symlink_to(path if kind == "itself" else kind)
    return f"replaced by {kind}"


# Changed values find the most.
DAMAGES: tuple[Damage, ...] = (cut, flip, fill, *[change_value] * 4, *[swap] * 3, *[no_file] * 2)
