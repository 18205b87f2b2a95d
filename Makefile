# make run    the main job, and a film of a ship that gives way; make run ARGS="target=4 method=scratch" another one
# make watch  nothing is trained: the network of case 4 gives way to two ships, in a window
# make test   style, types and tests; those that precision touches once more without bfloat16
# make test-long   the tests that `make test` leaves out, for they take half a minute or more each
# All install into .venv first, once for each change of pyproject.toml.

PYTHON ?= python3
VENV ?= .venv
ARGS ?= +pair=high method=finetune layers=3

BIN = $(VENV)/bin
# A second thread makes these small networks slower: one thread a process, one process a core.
export OMP_NUM_THREADS = 1

python_fits = $(shell $(PYTHON) -c "import sys; print((3, 11) <= sys.version_info[:2] <= (3, 12))" 2>/dev/null)
check_python = $(if $(filter True,$(python_fits)),,$(error ship_trl needs Python 3.11 or 3.12, and $(PYTHON) is not: try make PYTHON=python3.11))

.PHONY: run watch test test-long format clean
.NOTPARALLEL:

run: $(VENV)/.run
	$(BIN)/python -m ship_trl $(ARGS)
	$(BIN)/python -m ship_trl.record pretrained target=4 --size 960x540 --output outputs/give_way.gif

watch: $(VENV)/.run
	$(BIN)/python -m ship_trl.watch

test: $(VENV)/.test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m pytest
	SHIP_TRL_BFLOAT16=off $(BIN)/python -m pytest -m precision

test-long: $(VENV)/.test
	$(BIN)/python -m pytest -m long

format: $(VENV)/.test
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

clean:
	rm -rf $(VENV) dist build .mypy_cache .pytest_cache .ruff_cache .hypothesis

$(VENV)/.run: pyproject.toml
	$(check_python)
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --editable .
	touch $@

$(VENV)/.test: pyproject.toml
	$(check_python)
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --editable '.[dev]'
	touch $(VENV)/.run $@
