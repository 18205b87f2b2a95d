#!/usr/bin/env bash
# Pillow 13.0.0: quantize(palette=...) changes colours that stand in the palette.
#
# Expected: a colour that is in the palette keeps its value, whatever other colours are in it.
# Seen: the nearest colour is looked up for cubes of 4 x 4 x 4 colours, at the darkest corner of the cube. Another
# colour that is nearer to this corner wins, here 5 levels away. Flat colours of a GIF with one palette for all frames
# change so. Search with a palette whose values are multiples of 4, then put the real one in place.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet pillow==13.0.0
cd "$folder"
cat > run.py <<'PY'
from PIL import Image

flat = (26, 38, 59)
palette = [*flat, 23, 35, 54]


def quantized(search, shown):
    lookup = Image.new("P", (1, 1))
    lookup.putpalette(search)
    found = Image.new("RGB", (8, 8), flat).quantize(palette=lookup, dither=Image.Dither.NONE)
    found.putpalette(shown)
    return found.convert("RGB").getpixel((0, 0))


print("colour", flat)
print("quantized", quantized(palette, palette))
print("by multiples of 4", quantized([value - value % 4 for value in palette], palette))
PY
"$folder/venv/bin/python" run.py | tee output.txt
diff output.txt - <<'EXPECTED'
colour (26, 38, 59)
quantized (23, 35, 54)
by multiples of 4 (26, 38, 59)
EXPECTED
echo "as described"
