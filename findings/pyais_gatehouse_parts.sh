#!/usr/bin/env bash
# pyais 3.3.1: a message of two sentences loses its Gatehouse time if another ship's sentence comes between.
#
# Expected: the `$PGHP` line before a message's first sentence is the time of that message.
# Seen: the last such line before the message's last sentence is. With a line before each sentence, as a
# receiver writes it, the message has the time of its second half; with another ship's message between the
# halves it has none. The time is a datetime without a time zone.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet pyais==3.3.1
cd "$folder"
cat > run.py <<'PY'
from pyais import IterMessages


def hear(minute):
    return f"$PGHP,1,2021,5,17,9,{minute},15,500,219,0,2190047,1,5C*2A"


first = "!AIVDM,2,1,4,A,55O0W7`00001L@gCWGA2uItLth@DqtL5@F22220j1h742t0Ht0000000,0*08"
second = "!AIVDM,2,2,4,A,000000000000000,2*20"
other = "!AIVDM,1,1,,B,15M67FC000G?ufbE`FepT@3n00Sa,0*5C"
logs = {
    "one line": [hear(30), first, second],
    "a line each": [hear(30), first, hear(31), second],
    "another ship between": [hear(30), first, hear(31), other, second],
}
for name, lines in logs.items():
    for message in IterMessages([line.encode() for line in lines]):
        time = message.wrapper_msg and message.wrapper_msg.timestamp
        print(f"{name}: {message.decode().mmsi} {time and time.isoformat()}")
PY
"$folder/venv/bin/python" run.py 2>&1 | tee output.txt
diff output.txt - <<'EXPECTED'
one line: 368060190 2021-05-17T09:30:15.500000
a line each: 368060190 2021-05-17T09:31:15.500000
another ship between: 366053209 2021-05-17T09:31:15.500000
another ship between: 368060190 None
EXPECTED
echo "as described"
