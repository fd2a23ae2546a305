# Everything a person or CI does here. `make demo` and `make test` need only
# Python 3.11-3.14, make and git; the first of them makes .venv.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

# What `make demo` runs; make SEED=2 BIRTHS=3000 demo changes it.
SEED ?= 1
BIRTHS ?= 1500
DEMO = $(BIN)/revolve run scenario1 --seed $(SEED) --births $(BIRTHS) \
	--out runs/demo-$$(date +%Y%m%d-%H%M%S)-$$$$

.PHONY: help demo compiled test test-long test-many test-fresh bench lint format check proto \
	constraints clean

help:
	@echo 'make demo         evolve robots for about a minute'
	@echo 'make test         run all tests'
	@echo 'make test-long    run what is too long for CI: about an hour, as root'
	@echo 'make bench        hold the speed promises, on an idle machine'
	@echo 'make lint         ruff, mypy, import contracts'
	@echo 'make check        lint and test'
	@echo 'make format       let ruff format and mend'
	@echo 'make proto        write schema/wire/revolve_pb2.py(i) from revolve.proto'
	@echo 'make constraints  write constraints.txt anew from this environment'
	@echo 'make clean        remove the environment and all caches'

demo: $(STAMP)
	@$(DEMO)

# Tests start hundreds of processes, each of which would compile all of it again where
# Python is told to write no bytecode.
compiled: $(STAMP)
	@$(BIN)/python -m compileall -q schema coordinator worker analyzer analysis revolve.py

# Many small tests, two at a time; then those that start processes and often wait.
test: compiled
	$(BIN)/python -m pytest -q -n 2 -m 'not system and not benchmark'
	$(BIN)/python -m pytest -q -n 4 --dist worksteal -m 'system and not long'

# What CI has no time for: run it before a release and say what it gave.
test-long: test-many bench test-fresh

test-many: compiled
	$(BIN)/python -m pytest -q -n 2 --dist worksteal -m long

# make SUITES=sid test-fresh tries one release of Debian only.
test-fresh:
	@tests/fresh_machine.sh $(SUITES)

# Holds the speed promises to their figures: for a machine with nothing else to do.
bench: compiled
	$(BIN)/python -m pytest -q -s -m benchmark

lint: $(STAMP)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports

format: $(STAMP)
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

check: lint test

proto: $(STAMP)
	$(BIN)/python -m grpc_tools.protoc -I. --python_out=. --pyi_out=. \
		schema/wire/revolve.proto

# Only names and versions: where they come from is each machine's own matter.
constraints: $(STAMP)
	@{ sed -n '/^#/p' constraints.txt; \
	   $(BIN)/python -m pip freeze --all --exclude pip --exclude-editable; } > $(VENV)/constraints.txt
	@mv $(VENV)/constraints.txt constraints.txt

clean:
	rm -rf $(VENV) dist .hypothesis .import_linter_cache .mypy_cache \
		.pytest_cache .ruff_cache MUJOCO_LOG.TXT
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(STAMP): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 15))' \
		|| { echo 'Python 3.11, 3.12, 3.13 or 3.14 is needed, and "$(PYTHON)" is' \
		"$$($(PYTHON) --version 2>/dev/null || echo missing)." \
		'Name another: make PYTHON=python3.12 ...' >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null \
		|| { echo '"$(PYTHON)" lacks venv: install it (Debian: python3-venv)' >&2; \
		exit 1; }
	@echo 'Making $(VENV): about 1.7 GB on disk, a minute or two ...'
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check \
		-c constraints.txt -e '.[view,analysis,dev]'
	@echo '$(VENV) is ready.'
	@touch $@
