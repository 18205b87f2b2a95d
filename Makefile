# make run    the main job, and a film of its network; make run ARGS="target=4 method=scratch" another job, without that film
# make install  nothing but the virtual environment, for the commands of the README
# make watch  nothing is trained: the network of case 4 gives way to two ships, in a window
# make test   style, types and tests
# make test-long   the tests that `make test` leaves out, for they take long
# make docs   the documents as a site with an API reference, site/index.html; a dead link fails
# make lock   the newest versions that fit pyproject.toml into requirements.lock: make lock UPGRADE=--upgrade
# make audit  asks a public database whether a locked version has a known vulnerability
# All install into .venv first, by requirements.lock, once for each change of it or of pyproject.toml;
# `make LOCK= test` takes the newest versions instead.

# The first that fits makes .venv, unless there is one that fits, however it was made.
PYTHON ?= $(BIN)/python python3 python3.14 python3.13 python3.12 python3.11
VENV ?= .venv
LOCK ?= requirements.lock
UPGRADE ?=
ARGS ?= +pair=low method=finetune layers=3 source=pretrained
# The network of the film; with other arguments the run leaves its own episode.gif.
FILMED ?= $(if $(filter file,$(origin ARGS)),outputs/low/FT3-pretrained/seed=0)

BIN = $(VENV)/bin
# Beside the other: what these tools need must not change what is run and tested.
TOOLS = $(VENV)-tools
# Compiling all of torch takes as long as its installation; Python compiles what is imported, if it may write it.
INSTALL = $(BIN)/python -m pip install $(if $(PYTHONDONTWRITEBYTECODE),,--no-compile) $(if $(LOCK),--constraint $(LOCK)) --editable
# A second thread makes these small networks slower: one thread a process, one process a core.
export OMP_NUM_THREADS = 1

# Debian and Ubuntu leave ensurepip, which venv needs, to a package of its own.
FITS = import sys; __import__('pip' if sys.prefix != sys.base_prefix else 'ensurepip'); \
	sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 14))
python = $(or $(shell for one in $(PYTHON); do "$$one" -c "$(FITS)" 2>/dev/null && echo "$$one" && break; done), \
	$(error ship_trl needs Python 3.11 to 3.14 with venv, and none of $(PYTHON) is one. Install it \
	(Debian, Ubuntu: apt install python3-venv), name it (make PYTHON=python3.13), or make $(VENV) yourself: \
	uv venv --seed --python 3.13 $(VENV)))
make_venv = $(foreach found,$(python),$(if $(filter $(BIN)/python,$(found)),,$(found) -m venv $(VENV)))

.PHONY: run install watch test test-long format docs lock audit clean
.NOTPARALLEL:

run: $(VENV)/.run
	$(BIN)/python -m ship_trl $(ARGS)
	$(if $(FILMED),$(BIN)/python -m ship_trl record $(FILMED) --size 960x540 --output outputs/give_way.gif)

install: $(VENV)/.run

watch: $(VENV)/.run
	$(BIN)/python -m ship_trl watch

test: $(VENV)/.test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m pytest --numprocesses 2 --dist loadfile --no-loadscope-reorder

test-long: $(VENV)/.test
	$(BIN)/python -m pytest -m long

format: $(VENV)/.test
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

# The notice says that version 2 of MkDocs will differ; pyproject.toml keeps it below.
docs: $(VENV)/.test
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

# Keeps what is locked already, unless it is told to upgrade; --universal: one file for every system and Python.
lock: $(TOOLS)/.made
	$(TOOLS)/bin/uv pip compile --universal --python-version 3.11 --all-extras --no-emit-index-url \
		--no-emit-find-links --custom-compile-command "make lock" --quiet $(UPGRADE) --output-file requirements.lock pyproject.toml

# A package that the database does not know is an error too, not a silent pass.
audit: $(TOOLS)/.made
	$(TOOLS)/bin/pip-audit --strict --no-deps --disable-pip --requirement requirements.lock

clean:
	rm -rf $(VENV) $(TOOLS) dist build site .mypy_cache .pytest_cache .ruff_cache .hypothesis

$(VENV)/.run: pyproject.toml $(LOCK)
	$(make_venv)
	$(INSTALL) .
	touch $@

$(VENV)/.test: pyproject.toml $(LOCK)
	$(make_venv)
	$(INSTALL) '.[dev]'
	touch $(VENV)/.run $@

$(TOOLS)/.made:
	$(python) -m venv $(TOOLS)
	$(TOOLS)/bin/python -m pip install "uv>=0.9,<1" "pip-audit>=2.9,<3"
	touch $@
