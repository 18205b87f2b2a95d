#!/usr/bin/env bash
# pyais 3.3.1: sentences and tag blocks with a wrong checksum are decoded like any other.
#
# Expected: `IterMessages`, which drops what it cannot parse, drops a sentence whose checksum is wrong, or says so.
# Seen: it is decoded, here to another speed; only `is_valid` is False. Of a tag block with a wrong checksum the
# time is given all the same; only `tag_block.is_valid` is False.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet pyais==3.3.1
cd "$folder"
cat > run.py <<'PY'
from pyais import IterMessages, encode_dict


def checksum(text):
    total = 0
    for letter in text:
        total ^= ord(letter)
    return f"{total:02X}"


(right,) = encode_dict({"msg_type": 1, "mmsi": 219000001, "lat": 55.0, "lon": 10.0, "speed": 12.0, "course": 45.0})
# The tenth letter of the message, which holds the speed, is damaged on the way.
fields = right.split(",")
fields[5] = fields[5][:9] + "h" + fields[5][10:]
wrong = ",".join(fields)
tags = "c:1704067200"
for sentence, sum_of_tags in ((right, checksum(tags)), (wrong, checksum(tags)), (right, "00")):
    for message in IterMessages([f"\\{tags}*{sum_of_tags}\\{sentence}".encode()]):
        block = message.tag_block
        block.init()
        print(message.decode().speed, message.is_valid, block.receiver_timestamp, block.is_valid)
PY
"$folder/venv/bin/python" run.py 2>&1 | tee output.txt
diff output.txt - <<'EXPECTED'
12.0 True 1704067200 True
11.2 False 1704067200 True
12.0 True 1704067200 False
EXPECTED
echo "as described"
