#!/usr/bin/env bash
# OmegaConf 2.3.1 and PyYAML 6.0.3: text that one writes comes back from the other as a number.
#
# Expected: a file that yaml.safe_dump writes has the same values for OmegaConf (and so for Hydra), whose loader is a
# subclass of PyYAML's SafeLoader.
# Seen: OmegaConf adds an own pattern for numbers, in which an exponent needs no point. The commit "1e3", or the digest
# "12e4567", is written without quotes, as it is text for PyYAML, and becomes 1000.0 or infinity. OmegaConf.to_yaml
# quotes such text.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet omegaconf==2.3.1 pyyaml==6.0.3
cd "$folder"
cat > run.py <<'PY'
import yaml
from omegaconf import OmegaConf

for text in ("1e3", "12e4567", "1.5e3"):
    written = yaml.safe_dump({"name": text}).strip()
    ours = OmegaConf.to_yaml({"name": text}).strip()
    print(written, "| PyYAML", repr(yaml.safe_load(written)["name"]), "| OmegaConf", end=" ")
    print(repr(OmegaConf.create(written)["name"]), "| OmegaConf writes", ours)
PY
"$folder/venv/bin/python" run.py | tee output.txt
diff output.txt - <<'EXPECTED'
name: 1e3 | PyYAML '1e3' | OmegaConf 1000.0 | OmegaConf writes name: '1e3'
name: 12e4567 | PyYAML '12e4567' | OmegaConf inf | OmegaConf writes name: '12e4567'
name: 1.5e3 | PyYAML '1.5e3' | OmegaConf 1500.0 | OmegaConf writes name: '1.5e3'
EXPECTED
echo "as described"
