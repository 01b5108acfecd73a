# make fly    set up, fly a simulated drone through a room; leaves out/map.png, map.ply, report.json
# make test   set up, run the tests
# make test-fast   set up, run the tests that neither fly nor start programs
# make check  set up, run the linters, the type checker and the layers' contract
# make docs   build the documentation site into site/; a broken link, anchor or page in the navigation fails

PYTHON ?= python3
VENV := .venv
SPEED ?= 1000

# the site is built from a copy of these, so that links from docs to other files work as on GitHub
DOCUMENTED := README.md CHANGELOG.md CONTRIBUTING.md LICENSE docs benchmarks companion deploy examples sitl tests

.PHONY: setup fly test test-fast check docs

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
	@$(VENV)/bin/pytest --hypothesis-profile fast -m "unit or contract" tests/unit tests/contract

check: setup
	@$(VENV)/bin/ruff check
	@$(VENV)/bin/ruff format --check
	@$(VENV)/bin/mypy
	@$(VENV)/bin/lint-imports

docs: $(VENV)/.docs
	@rm -rf build/docs && mkdir -p build/docs
	@tar -c --exclude=__pycache__ $(DOCUMENTED) | tar -x -C build/docs
	@mv build/docs/docs/nav.yml build/docs/.nav.yml
	@$(VENV)/bin/zensical build --clean --strict
	@echo "open site/index.html"

$(VENV)/.docs: pyproject.toml
	@test -x $(VENV)/bin/python || $(PYTHON) -m venv $(VENV)
	@$(VENV)/bin/pip install --quiet --disable-pip-version-check --editable '.[docs]'
	@touch $@
