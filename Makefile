# On a fresh machine with Python 3.11+, a C++ compiler and make: `make demo`, `make test`.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
CORE := CMakeLists.txt $(wildcard src/core/*)

.PHONY: demo test check format stub sanitize bench lock clean

demo: $(INSTALLED)  ## run the paper's maze with gates and bushes to its last delivery
	$(BIN)/oath run missions/maze-25-gates.yaml --out out
	$(BIN)/oath verify missions/maze-25-gates.yaml out/events.jsonl

test: $(INSTALLED)  ## every test
	$(BIN)/ruff check . && $(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/pytest -n 2

check: $(INSTALLED)  ## the fast inner loop: format, lint, types, fast tests
	$(BIN)/ruff format . && $(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/pytest -n 2 -m "not slow"

# One environment for everything, with the versions of the lock file. The package is installed
# editable, so only a change of the core or of the dependencies installs again.
$(INSTALLED): pyproject.toml requirements.lock $(CORE)
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "OATH needs Python 3.11 or newer: make PYTHON=/path/to/python3.11"; exit 1; }
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	PIP_CONSTRAINT=requirements.lock $(BIN)/python -m pip install --quiet --disable-pip-version-check \
	  --editable '.[dev]'
	touch $@

stub: $(INSTALLED)  ## generate the compiled module's type stub
	$(BIN)/python -m nanobind.stubgen -q -m oath._core -o src/oath/_core.pyi

sanitize: $(INSTALLED)  ## the tests of the core under the address and undefined-behaviour sanitizers
	PATH="$(CURDIR)/$(BIN):$$PATH" tests/sanitize.sh

bench: $(INSTALLED)  ## every figure of the README
	for file in bench/*.py; do $(BIN)/python $$file || exit 1; done

lock: $(INSTALLED)  ## write the versions in use to the lock file
	$(BIN)/python -m pip freeze --exclude-editable > requirements.lock

clean:
	rm -rf $(VENV) build out
