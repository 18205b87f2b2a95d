"""What may become of a file: cut short, bits turned over, another kind of file, or made to do harm.

Each damage takes a path and a generator of random numbers, and puts something else in its place.
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
from PIL import Image

# Made by whatever a hostile file lets run.
EXECUTED = "EXECUTED"
# Values that no reader expects where it reads them.
ODD: tuple[Any, ...] = (
    *(None, True, -1, 0, 1, 2**31, 2**63, 2**64, 10**400, 1e308, -1e308, float("nan"), float("inf"), 1.5),
    *(
        "",
        "x",
        "nan",
        "1e999",
        "../../../../etc/passwd",
        "/etc/passwd",
        "a\x00b",
        "\ud800",
        "\n\n",
        "${oc.env:HOME}",
    ),
    *(
        "${seed}",
        "??? ",
        "x" * 100_000,
        [],
        {},
        [[]],
        [None],
        {"": 1},
        [1] * 50,
        "☃",
        "-1",
        "0x10",
        "0" * 5000,
    ),
)

Damage = Callable[[Path, random.Random], str]


def replace(path: Path, data: bytes) -> None:
    """Put other bytes in a file's place; another name of the same file keeps its own."""
    path.unlink()
    path.write_bytes(data)


def cut(path: Path, rng: random.Random) -> str:
    """Cut a file short."""
    data = path.read_bytes()
    size = rng.randrange(len(data)) if data else 0
    replace(path, data[:size])
    return f"cut to {size} bytes"


def flip(path: Path, rng: random.Random) -> str:
    """Turn bits over; of a large file half of them in its beginning, where its header is."""
    data = bytearray(path.read_bytes())
    places = []
    for _ in range(rng.choice((1, 1, 1, 2, 8, 64))):
        end = len(data) if rng.random() < 0.5 else min(len(data), 2000)
        if end:
            place, bit = rng.randrange(end), rng.randrange(8)
            data[place] ^= 1 << bit
            places.append(f"{place}.{bit}")
    replace(path, bytes(data))
    return f"bits turned over at {', '.join(places[:8])}"


def empty(path: Path, rng: random.Random) -> str:
    """Leave nothing in a file."""
    replace(path, b"")
    return "emptied"


def noise(path: Path, rng: random.Random) -> str:
    """Fill a file with noise, as many zeros, or twice with itself."""
    data = path.read_bytes()
    kind = rng.choice(("noise", "zeros", "itself twice"))
    made = {"noise": rng.randbytes(len(data)), "zeros": bytes(len(data)), "itself twice": data + data}
    replace(path, made[kind])
    return f"filled with {kind}"


def spliced(path: Path, rng: random.Random) -> str:
    """Take some bytes out of a file, or put some of its own in at another place."""
    data = path.read_bytes()
    one, other, to = sorted(rng.randrange(len(data) + 1) for _ in range(3))
    replace(
        path, data[:one] + data[other:] if rng.random() < 0.5 else data[:to] + data[one:other] + data[to:]
    )
    return f"spliced at {one}, {other}, {to}"


def swap(path: Path, rng: random.Random) -> str:
    """Put a file of another kind in its place."""
    name = rng.choice(sorted(others()))
    replace(path, others()[name])
    return f"{name} in its place"


@cache
def others() -> dict[str, bytes]:
    """Give files of other kinds, some of which would run something or fill the memory."""
    made: dict[str, bytes] = {}
    for kind in ("GIF", "PNG"):
        file = io.BytesIO()
        Image.new("L", (84, 84)).save(file, kind)
        made[kind] = file.getvalue()
    made["a pickle"] = pickle.dumps(Executes())
    made["a shell script"] = f"#!/bin/sh\ntouch {EXECUTED}\n".encode()
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("../../archive/data.pkl", pickle.dumps(Executes()))
        archive.writestr("zeros", bytes(200_000_000))
    made["a zip bomb"] = file.getvalue()
    made["an xz bomb"] = lzma.compress(bytes(300_000_000), preset=0)
    made["YAML tags"] = f"!!python/object/apply:os.system ['touch {EXECUTED}']\n".encode()
    made["a YAML tag in a key"] = f"start: !!python/object/apply:os.system ['touch {EXECUTED}']\n".encode()
    made["exploding aliases"] = laughs("l", 9)
    made["long aliases"] = laughs("start", 25)
    made["a list without end"] = b"&a [*a]\n"
    made["a deep list"] = b"[" * 200_000
    made["a deep object"] = b'{"a":' * 200_000
    made["deep YAML"] = b"".join(b" " * k + b"a:\n" for k in range(3000))
    made["a JSON list"] = b"[1, 2]"
    made["a JSON null"] = b"null"
    made["a JSON text"] = b'"text"'
    made["an empty object"] = b"{}"
    made["a very long number"] = b'{"a": ' + b"9" * 100_000 + b"}"
    made["a CSV of one column"] = b"a\n" * 1000
    made["a CSV line without end"] = b"episode," * 500_000
    made["an open quote"] = b'episode,steps\n"' + b"x" * 100_000
    made["UTF-16"] = "start: [0, 0]\n".encode("utf-16")
    made["Latin-1"] = "start: \xe4\xff\n".encode("latin-1")
    made["carriage returns"] = b"\r" * 1000
    for name, size in {"of 2^63": 2**63, "of 2^40": 2**40, "of 99 MB": 99_000_000, "of nothing": 0}.items():
        made[f"a safetensors header {name}"] = struct.pack("<Q", size) + b"{}" * 50
    for name, text in HEADERS.items():
        made[f"safetensors with {name}"] = struct.pack("<Q", len(text)) + text.encode() + bytes(64)
    return made


HEADERS = {
    "a huge shape": '{"conv1.weight":{"dtype":"F32","shape":[4294967296,4294967296],"data_offsets":[0,64]}}',
    "offsets beyond the file": '{"a":{"dtype":"F32","shape":[1000000],"data_offsets":[0,4000000]}}',
    "no tensor": '{"__metadata__":{"ship_trl":"[]"}}',
    "a list for its network": '{"__metadata__":{"ship_trl":"{\\"network\\": []}"}}',
    "a deep network": '{"__metadata__":{"ship_trl":"' + "[" * 100_000 + '"}}',
}


class Executes:
    """What a pickle of it runs when it is read."""

    def __reduce__(self) -> tuple[Any, ...]:
        return os.system, (f"touch {EXECUTED}",)


def laughs(key: str, levels: int) -> bytes:
    """YAML whose aliases stand for lists of lists, ten times as many at each level."""
    lines = [f"{key}0: &a0 [x, x]"]
    lines += [f"{key}{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]" for n in range(1, levels)]
    return "\n".join(lines).encode()


def odd_value(path: Path, rng: random.Random) -> str:
    """Change a value of a file whose form stays whole: JSON, YAML, CSV, or the header of safetensors."""
    data = path.read_bytes()
    try:
        if path.suffix == ".json":
            values = json.loads(data)
            where = change(values, rng)
            made = json.dumps(values).encode()
        elif path.suffix == ".yaml":
            values = yaml.safe_load(data)
            where = change(values, rng)
            made = yaml.safe_dump(values, sort_keys=False).encode()
        elif path.suffix == ".csv":
            lines = data.decode().split("\n")
            row = rng.randrange(len(lines))
            cells = lines[row].split(",")
            column = rng.randrange(len(cells))
            cells[column] = str(rng.choice(ODD))[:10_000]
            lines[row], where = ",".join(cells), f"line {row}, cell {column}: {cells[column]:.40}"
            made = "\n".join(lines).encode(errors="replace")
        elif path.suffix == ".safetensors":
            (size,) = struct.unpack("<Q", data[:8])
            header = json.loads(data[8 : 8 + size])
            if rng.random() < 0.5:
                about = json.loads(header["__metadata__"]["ship_trl"])
                where = change(about, rng)
                header["__metadata__"]["ship_trl"] = json.dumps(about)
            else:
                where = change(header, rng)
            text = json.dumps(header).encode()
            made = struct.pack("<Q", len(text)) + text + data[8 + size :]
        else:
            return flip(path, rng)
    except (ValueError, yaml.YAMLError):
        return flip(path, rng)
    replace(path, made)
    return f"an odd value: {where}"


def change(values: Any, rng: random.Random) -> str:
    """Change one value inside lists and objects, or take it out, or give its key another name."""
    trail: list[str] = []
    while True:
        keys = list(values) if isinstance(values, dict) else list(range(len(values)))
        if not keys:
            return f"{'.'.join(trail)} is empty"
        key = rng.choice(keys)
        trail.append(str(key))
        inner = values[key]
        if isinstance(inner, dict | list) and inner and rng.random() < 0.8:
            values = inner
            continue
        how = rng.random()
        if how < 0.1:
            del values[key]
            return f"{'.'.join(trail)} taken out"
        if how < 0.15 and isinstance(values, dict):
            values["odd"] = values.pop(key)
            return f"{'.'.join(trail)} renamed"
        values[key] = rng.choice(ODD)
        return f"{'.'.join(trail)}: {str(values[key])[:40]!a}"


def special(path: Path, rng: random.Random) -> str:
    """Put something in a file's place that is no file."""
    kind = rng.choice(("directory", "FIFO", "link to itself", "link to nothing", *LINKS))
    path.unlink()
    if kind == "directory":
        path.mkdir()
    elif kind == "FIFO":
        os.mkfifo(path)
    elif kind == "link to itself":
        path.symlink_to(path)
    elif kind == "link to nothing":
        path.symlink_to("/nowhere/at/all")
    else:
        path.symlink_to(kind)
    return kind


LINKS = ("/etc/passwd", "/dev/zero", "/dev/null", "/proc/self/mem", "/")


def not_readable(path: Path, rng: random.Random) -> str:
    """Take a file away, or its whole folder."""
    if rng.random() < 0.7:
        path.unlink()
        return "taken away"
    shutil.rmtree(path.parent)
    return "taken away with its folder"


DAMAGES: tuple[Damage, ...] = (
    *(cut, flip, empty, noise, spliced, not_readable),
    # These find the most.
    *(odd_value,) * 6,
    *(swap,) * 4,
    *(special,) * 2,
)
