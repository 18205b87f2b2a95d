#!/usr/bin/env bash
# pydantic 2.14.3 on an OmegaConf 2.3.1 configuration: a mandatory value that is missing takes the model's default.
#
# Expected: `steps: ???`, OmegaConf's and Hydra's mark of a value that must be given, is refused by
# Model.model_validate(config), as it is by Model(**config) and by config.steps.
# Seen: the model takes its default without a word. In a field that is a dictionary the same mark is refused.
# Convert first with OmegaConf.to_container(config, resolve=True, throw_on_missing=True).
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet pydantic==2.14.3 omegaconf==2.3.1
cd "$folder"
cat > run.py <<'PY'
from omegaconf import OmegaConf
from pydantic import BaseModel


class Model(BaseModel):
    steps: int = 1
    weights: dict[str, float] = {}


def shown(read) -> str:
    try:
        return str(read())
    except Exception as error:
        return type(error).__name__


config = OmegaConf.create({"steps": "???"})
print("model_validate:", shown(lambda: Model.model_validate(config)))
print("keywords:", shown(lambda: Model(**config)))
print("in a dictionary:", shown(lambda: Model.model_validate(OmegaConf.create({"weights": {"a": "???"}}))))
container = lambda: OmegaConf.to_container(config, resolve=True, throw_on_missing=True)
print("converted first:", shown(lambda: Model.model_validate(container())))
PY
"$folder/venv/bin/python" run.py | tee output.txt
diff output.txt - <<'EXPECTED'
model_validate: steps=1 weights={}
keywords: MissingMandatoryValue
in a dictionary: ValidationError
converted first: MissingMandatoryValue
EXPECTED
echo "as described"
