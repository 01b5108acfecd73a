# make fly   set up and fly a simulated drone through a room; leaves out/map.png, map.ply, report.json
# make test  set up and run the checks and tests

PYTHON ?= python3
VENV := .venv
SPEED ?= 30

.PHONY: setup fly test check

setup: $(VENV)/.ready

$(VENV)/.ready: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "Python 3.11 or newer is needed; name one with: make PYTHON=python3.12 $(MAKECMDGOALS)"; exit 1; }
	@$(PYTHON) -c 'import ensurepip' 2>/dev/null \
		|| { echo "Python's venv is missing; on Debian: apt install python3-venv"; exit 1; }
	@echo "setting up $(VENV); this is done once"
	$(PYTHON) -m venv $(VENV)
	$(VENV)/bin/pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

fly: setup
	$(VENV)/bin/sitl fly room_100 --transport udp --speed $(SPEED) --out out

test: setup
	$(VENV)/bin/pytest

check: setup
	$(VENV)/bin/ruff check
	$(VENV)/bin/ruff format --check
	$(VENV)/bin/mypy
	$(VENV)/bin/lint-imports
