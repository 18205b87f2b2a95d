#!/usr/bin/env bash
# tbparse 0.0.9: keeps the points that a resumed run has replaced.
#
# Expected: a run resumed with SummaryWriter(purge_step=30) replaces what it had logged from step 30 on, in tbparse as
# in TensorBoard.
# Seen: TensorBoard's own reader drops the replaced points. tbparse returns old and new points of the same step, two
# rows a step, sorted among each other. Without purge_step, TensorBoard's reader keeps both too, and its steps go
# back: a mean over a window of steps counts that part of the run twice.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet torch==2.13.0 tensorboard==2.21.0 tbparse==0.0.9 pandas==3.1.1 setuptools==84.2.1
cd "$folder"
cat > run.py <<'PY'
import logging
import time

from tbparse import SummaryReader
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from torch.utils.tensorboard import SummaryWriter

logging.disable(logging.CRITICAL)
for folder, purge in (("purged", 30), ("plain", None)):
    with SummaryWriter(folder) as writer:
        for step in (0, 10, 20, 30, 40):
            writer.add_scalar("return", float(step), step)
    time.sleep(1.1)  # the name of an event file holds the second
    with SummaryWriter(folder, purge_step=purge) as writer:
        for step in (30, 40, 50):
            writer.add_scalar("return", 100.0 + step, step)
    log = EventAccumulator(folder).Reload()
    print(folder, "tensorboard", [(point.step, point.value) for point in log.Scalars("return")])
    table = SummaryReader(folder).scalars
    print(folder, "tbparse", list(zip(table["step"].tolist(), table["value"].tolist(), strict=True)))
PY
"$folder/venv/bin/python" run.py | tee output.txt
diff output.txt - <<'EXPECTED'
purged tensorboard [(0, 0.0), (10, 10.0), (20, 20.0), (30, 130.0), (40, 140.0), (50, 150.0)]
purged tbparse [(0, 0.0), (10, 10.0), (20, 20.0), (30, 30.0), (30, 130.0), (40, 40.0), (40, 140.0), (50, 150.0)]
plain tensorboard [(0, 0.0), (10, 10.0), (20, 20.0), (30, 30.0), (40, 40.0), (30, 130.0), (40, 140.0), (50, 150.0)]
plain tbparse [(0, 0.0), (10, 10.0), (20, 20.0), (30, 30.0), (30, 130.0), (40, 40.0), (40, 140.0), (50, 150.0)]
EXPECTED
echo "as described"
