# yawbench: every target sets up what it needs.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
READY_TO_TEST := $(VENV)/.ready-to-test
# By file, since a study runs once for all tests of its file; in the order of tests/conftest.py.
PYTEST = $(BIN)/python -m pytest -n auto --dist loadfile --no-loadscope-reorder
SCENARIO ?= scenarios/fnn_sideslip/25mps.yaml
unexport PYTHONDONTWRITEBYTECODE  # runs are processes: modules are compiled once, not in each of them

.PHONY: setup fmus demo report run test test-all campaigns bench lint format docs clean

setup: $(READY)

$(READY): pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --editable .
	touch $@

$(READY_TO_TEST): $(READY)
	$(BIN)/python -m pip install --quiet --editable '.[test,lint]'
	touch $@

fmus: setup
	$(BIN)/yawbench build

demo: setup  # builds the FMUs that it needs
	$(BIN)/yawbench report --quick scenarios/fnn_sideslip/study.yaml

report: fmus
	$(BIN)/yawbench report

run: setup
	$(BIN)/yawbench run $(SCENARIO)

test: $(READY_TO_TEST) fmus  # what checks everything once; test-all adds what is exhaustive
	$(PYTEST) -m "not exhaustive"

test-all: $(READY_TO_TEST) fmus
	$(PYTEST)

campaigns: $(READY_TO_TEST) fmus  # attacks on the program, an hour
	$(BIN)/python -m campaigns

bench: $(READY_TO_TEST) fmus
	$(BIN)/python -m benchmarks.runs
	$(BIN)/python -m benchmarks.pages

lint: $(READY_TO_TEST)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: $(READY_TO_TEST)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

docs: $(READY_TO_TEST) fmus
	$(BIN)/python -m docs.generate
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --quiet --strict
	@echo "The docs: site/index.html"

clean:
	rm -rf $(VENV) build site fmus/*.fmu *.egg-info .pytest_cache .ruff_cache .mypy_cache
