# make fly    set up, fly a simulated drone through a room; leaves out/map.png, map.ply, report.json
# make test   set up, run the tests
# make test-fast   set up, run the tests that neither fly nor start programs
# make check  set up, run the linters, the type checker and the layers' contract

PYTHON ?= python3
VENV := .venv
SPEED ?= 1000

.PHONY: setup fly test test-fast check

setup: $(VENV)/.ready

$(VENV)/.ready: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "Python 3.11 or newer is needed; name one: make PYTHON=python3.12 ..."; exit 1; }
	@$(PYTHON) -c 'import ensurepip' 2>/dev/null || \
		{ echo "Python's venv is missing; on Debian: apt install python3-venv"; exit 1; }
	@echo "setting up $(VENV), once"
	@$(PYTHON) -m venv $(VENV)
	@$(VENV)/bin/pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

fly: setup
	@$(VENV)/bin/sitl fly room_100 --transport udp --speed $(SPEED) --out out

test: setup
	@$(VENV)/bin/pytest

test-fast: setup
	@$(VENV)/bin/pytest -m "unit or contract" tests/unit tests/contract

check: setup
	@$(VENV)/bin/ruff check
	@$(VENV)/bin/ruff format --check
	@$(VENV)/bin/mypy
	@$(VENV)/bin/lint-imports
