#!/usr/bin/env bash
# zstandard 0.25.0: three ways to unpack a file stop after its first frame, three others go on.
#
# Expected: all ways give the same, or the shorter ones say that something is left. A file of two frames, as
# `cat a.csv.zst b.csv.zst` or a tool with several threads writes it, is a valid file.
# Seen: `decompress`, `read_to_iter` and `decompressobj` give the first frame without a word; `stream_reader`,
# whose `read_across_frames` is False by default, `copy_stream` and `open` give both.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet zstandard==0.25.0
cd "$folder"
cat > run.py <<'PY'
import io

import zstandard

pack, unpack = zstandard.ZstdCompressor(), zstandard.ZstdDecompressor()
data = pack.compress(b"mmsi,sog\n1,2\n") + pack.compress(b"3,4\n5,6\n7,8\n")
with open("day.csv.zst", "wb") as file:
    file.write(data)
copied = io.BytesIO()
unpack.copy_stream(io.BytesIO(data), copied)
with zstandard.open("day.csv.zst", "rb") as file:
    opened = file.read()
found = {
    "decompress": unpack.decompress(data),
    "read_to_iter": b"".join(unpack.read_to_iter(io.BytesIO(data))),
    "decompressobj": unpack.decompressobj().decompress(data),
    "stream_reader": unpack.stream_reader(data).read(),
    "copy_stream": copied.getvalue(),
    "open": opened,
}
for name, text in found.items():
    print(name, text.count(b"\n"), "of 5 lines")
PY
"$folder/venv/bin/python" run.py 2>&1 | tee output.txt
diff output.txt - <<'EXPECTED'
decompress 2 of 5 lines
read_to_iter 2 of 5 lines
decompressobj 2 of 5 lines
stream_reader 5 of 5 lines
copy_stream 5 of 5 lines
open 5 of 5 lines
EXPECTED
echo "as described"
