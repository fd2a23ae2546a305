# Commands for users, developers and CI. `make demo` and `make test` need only
# Python 3.11-3.14, make and git; the first of them creates .venv.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# The environment has what running, pictures and analysis need (NEEDED), everything
# (STAMP), which also serves `make demo`, or what the docs site needs (DOCS_STAMP).
NEEDED := $(VENV)/.installed-needed
STAMP := $(VENV)/.installed
DOCS_STAMP := $(VENV)/.docs-installed
# pip has the settings of this machine, such as another package index.
INSTALL ?= $(BIN)/python -m pip install --disable-pip-version-check --no-compile \
	--progress-bar off
# All of them write to one environment.
.NOTPARALLEL:

# Settings of `make demo`; to change them: make SEED=2 BIRTHS=3000 demo.
SEED ?= 1
BIRTHS ?= 1000

.PHONY: help demo compiled test test-long test-many test-fresh bench lint format check proto \
	constraints clean

help:
	@echo 'make demo         evolve robots for a minute: film, fitness curve, report'
	@echo 'make test         run all tests'
	@echo 'make test-long    run the tests that are too long for CI: about an hour, as root'
	@echo 'make bench        check the performance targets, on an idle machine'
	@echo 'make lint         ruff, mypy, import contracts'
	@echo 'make check        lint and test'
	@echo 'make format       fix and format the code with ruff'
	@echo 'make proto        write schema/wire/revolve_pb2.py(i) from revolve.proto'
	@echo 'make constraints  update constraints.txt from this environment'
	@echo 'make docs         build the docs site, docs/_build/html'
	@echo 'make docs-serve   build the docs site and show it on this machine; Ctrl-C ends'
	@echo 'make clean        remove the environment and all caches'

demo: $(NEEDED)
	@set -e; run=runs/demo-$$(date +%Y%m%d-%H%M%S)-$$$$; \
	$(BIN)/revolve run scenario1 --seed $(SEED) --births $(BIRTHS) --out $$run; \
	echo; \
	robustness=$$($(BIN)/revolve robot simulate $$run/best.yaml --robustness); \
	printf 'best robot: '; echo "$$robustness" | tail -n 1; \
	$(BIN)/revolve robot render $$run/best.yaml $$run/best.gif --size 480 --seconds 6 --trail --start-mark; \
	$(BIN)/revolve analyze $$run --out $$run/report > $$run/report.txt \
		|| { cat $$run/report.txt; exit 1; }; \
	cp $$run/report/figures/*6.3*.png $$run/fitness.png; \
	echo; echo 'To look at:'; \
	echo "  $$run/best.gif            the best robot, moving"; \
	echo "  $$run/fitness.png         fitness over births"; \
	echo "  $$run/report/report.html  all figures and measures, for a browser"; \
	echo 'To type `revolve ...` as above: . $(BIN)/activate'

# Tests start hundreds of processes. Where Python is configured to write no bytecode,
# each of them would compile all modules again.
compiled: $(STAMP)
	@$(BIN)/python -m compileall -q schema coordinator worker analyzer analysis revolve

# Unit tests, of which some wait for the disk; then system tests, which start processes
# and often wait.
# Each process of pytest imports all files that it is given, in ten seconds all of them,
# or in six if it finds them compiled.
test: export PYTHONDONTWRITEBYTECODE =
test: compiled
	$(BIN)/python -m pytest -q -n 3 -m 'not system and not benchmark and not long'
	$(BIN)/python -m pytest -q -n 5 --dist worksteal -m 'system and not long' \
		$$(grep -rl 'mark\.system' tests --include='test_*.py')

# Tests that are too long for CI: run them before a release and report the results.
test-long: test-many bench test-fresh

test-many: compiled $(DOCS_STAMP)
	@# A reader of phylogenies, 180 MB with what it needs, for one test.
	$(BIN)/python -m pip install -q -c constraints.txt phyloframe
	$(BIN)/python -m pytest -q -n 2 --dist worksteal -m long

# To test one release of Debian only: make SUITES=sid test-fresh.
test-fresh:
	@tests/fresh_machine.sh $(SUITES)

# Check the performance targets; needs an idle machine.
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

# Only names and versions: each machine configures its own package sources.
constraints: $(STAMP) $(DOCS_STAMP)
	@{ sed -n '/^#/p' constraints.txt; \
	   $(BIN)/python -m pip freeze --all --exclude pip --exclude-editable; } > $(VENV)/constraints.txt
	@mv $(VENV)/constraints.txt constraints.txt

# The docs site, from docs/*.md; its generator is an extra of its own.
DOCS_PORT ?= 8000
.PHONY: docs docs-serve
docs: $(DOCS_STAMP)
	@$(BIN)/python -m sphinx -q -E -W --keep-going docs docs/_build/html
	@echo 'The site is in docs/_build/html; make docs-serve shows it.'

docs-serve: docs
	@echo 'Open http://127.0.0.1:$(DOCS_PORT)/ in a browser; press Ctrl-C to stop.'
	@$(BIN)/python -m http.server --bind 127.0.0.1 --directory docs/_build/html \
		$(DOCS_PORT) 2> $(VENV)/docs-serve.log \
		|| { tail -n 1 $(VENV)/docs-serve.log >&2; \
		echo 'To use another port: make DOCS_PORT=8001 docs-serve' >&2; exit 1; }

clean:
	rm -rf $(VENV) docs/_build dist .hypothesis .import_linter_cache .mypy_cache \
		.pytest_cache .ruff_cache MUJOCO_LOG.TXT
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(NEEDED): EXTRAS := pictures,analysis
$(NEEDED): SIZE := 1 GB
$(STAMP): EXTRAS := all,dev
$(STAMP): SIZE := 2 GB
$(STAMP): ALSO := $(NEEDED)
$(DOCS_STAMP): EXTRAS := docs
$(DOCS_STAMP): SIZE := 600 MB
# Dots are packages. Modules are compiled by all cores, which pip does not do; tests of
# packages are not compiled.
$(NEEDED) $(STAMP) $(DOCS_STAMP): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 15))' \
		|| { echo 'Python 3.11, 3.12, 3.13 or 3.14 is needed, and "$(PYTHON)" is' \
		"$$($(PYTHON) --version 2>/dev/null || echo missing)." \
		'Name another: make PYTHON=python3.12 ...' >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null \
		|| { echo '"$(PYTHON)" lacks venv: install it (Debian: python3-venv)' >&2; \
		exit 1; }
	@echo 'Installing what $(VENV) needs: about $(SIZE) on disk in all, a minute or two.'
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@{ $(INSTALL) -c constraints.txt -e '.[$(EXTRAS)]'; echo "ended $$?"; } \
		| awk 'BEGIN { printf "Downloading " } /Downloading|Using cached/ { printf "." } \
			/^Installing/ { printf "\nInstalling ...\n" } { fflush() } \
			END { if (!/^ended 0$$/) print ""; exit !/^ended 0$$/ }'
	@$(BIN)/python -m compileall -q -j 0 -x '/tests?/' $(VENV)/lib || true
	@echo '$(VENV) is ready.'
	@touch $@ $(ALSO)
