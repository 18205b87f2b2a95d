#!/usr/bin/env bash
# pyais 3.3.1: two stations' halves of a message are joined to one that no ship has sent.
#
# Expected: sentences whose tag blocks have different groups (g:) and stations (s:) are kept apart.
# Seen: only sequence number, channel and count are looked at. Of two messages that arrive interleaved, one is
# lost, and the other is the first half of one ship with the second half of another: here BRAVO's name with the
# end of ALPHA's destination. All checksums are right.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet pyais==3.3.1
cd "$folder"
cat > run.py <<'PY'
from pyais import IterMessages, encode_dict


def halves(mmsi, name, destination, station, group):
    values = {"msg_type": 5, "mmsi": mmsi, "shipname": name, "destination": destination}
    for number, sentence in enumerate(encode_dict(values, seq_id=1), 1):
        tags = f"g:{number}-2-{group},s:{station},c:1704067200"
        total = 0
        for letter in tags:
            total ^= ord(letter)
        yield f"\\{tags}*{total:02X}\\{sentence}".encode()


first = list(halves(219000001, "ALPHA", "AARHUS EAST HARBOUR", "one", 11))
second = list(halves(219000002, "BRAVO", "BERGEN WEST TERMINAL", "two", 22))
for word, lines in (("in turn", first + second), ("interleaved", [first[0], second[0], first[1], second[1]])):
    for message in IterMessages(lines):
        report = message.decode()
        print(f"{word}:", report.mmsi, report.shipname, report.destination, message.is_valid)
PY
"$folder/venv/bin/python" run.py 2>&1 | tee output.txt
diff output.txt - <<'EXPECTED'
in turn: 219000001 ALPHA AARHUS EAST HARBOUR True
in turn: 219000002 BRAVO BERGEN WEST TERMINAL True
interleaved: 219000002 BRAVO BERGEN WEST HARBOUR True
EXPECTED
echo "as described"
