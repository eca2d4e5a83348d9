# Everything below works on a fresh machine: each target makes the virtual environment that it needs.
PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

LOWEST := .venv-lowest

.DEFAULT_GOAL := help
.PHONY: help setup demo test test-slow test-lowest test-python check format accuracy bench bench-check clean

help: ## Show this list
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

setup: $(STAMP) ## Make the virtual environment and install the package with all extras

$(STAMP): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --editable '.[dev]'
	@touch $@

demo: $(STAMP) ## Build features from small sample recordings, and show where they are
	$(BIN)/python examples/demo.py

test: $(STAMP) ## Run the quick tests
	$(BIN)/python -m pytest -n auto --dist worksteal

test-slow: $(STAMP) ## Run the tests that take longer
	$(BIN)/python -m pytest -n auto --dist worksteal -m slow

test-lowest: $(LOWEST)/.installed ## Run the quick tests with the lowest versions that pyproject.toml allows
	$(LOWEST)/bin/python -m pytest -n auto --dist worksteal

# uv alone can resolve downward; it lies in an environment of its own so that the tests see nothing of it
$(LOWEST)/.installed: pyproject.toml
	$(PYTHON) -m venv --clear $(LOWEST)-uv
	$(LOWEST)-uv/bin/python -m pip install --quiet uv
	$(PYTHON) -m venv --clear $(LOWEST)
	$(LOWEST)-uv/bin/uv pip install --quiet --python $(LOWEST)/bin/python --resolution lowest-direct --editable '.[bench,dask,mcap,simulate,test,view]'
	@touch $@

# PYENV_VERSION chooses among the versions of pyenv, where that is what makes pythonX.Y
test-python: ## Run the quick tests on another Python: make test-python VERSION=3.13
	@test -n "$(VERSION)" || { echo "which Python? make test-python VERSION=3.13" >&2; exit 2; }
	PYENV_VERSION=$(VERSION) $(MAKE) test PYTHON=python$(VERSION) VENV=.venv-$(VERSION)

check: $(STAMP) ## Lint, check the format and the types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: $(STAMP) ## Format the code
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

accuracy: $(STAMP) ## Simulate, build and score; rewrites the pages of accuracy in docs/ (some 30 minutes)
	$(BIN)/python benchmarks/accuracy.py
	$(BIN)/python benchmarks/accuracy_nuisances.py
	$(BIN)/python benchmarks/accuracy_color.py
	$(BIN)/python benchmarks/tracks.py

bench: $(STAMP) ## Run the side-by-side measurements
	@for script in $(filter-out benchmarks/accuracy% benchmarks/ratios.py benchmarks/tracks.py,$(wildcard benchmarks/*.py)); do echo "== $$script"; $(BIN)/python $$script || exit 1; done

bench-check: $(STAMP) ## Measure a few ratios at small sizes, and compare them with what they are to be
	$(BIN)/python benchmarks/ratios.py

clean: ## Remove what the targets above made, the demo included
	rm -rf $(VENV) .venv-* demo dist build .pytest_cache .mypy_cache .ruff_cache .hypothesis
