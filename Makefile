# Two commands do everything on a fresh machine with Python (3.11 or later) and make:
#   make demo   the story: an image, a few readings, an answer with its spread, a report
#   make test   lint, types, contracts and tests
# make test-all runs the slow tests, too: the statistics over many scenes.
# make docs makes the site in build/docs.
PYTHON ?= python3
VENV   ?= .venv
BIN     = $(VENV)/bin
TESTS   = -m "not slow"
PIP     = $(BIN)/python -m pip --disable-pip-version-check

.PHONY: demo test test-all check unit docs bench clean

demo: $(VENV)/.demo
	$(BIN)/tanteo demo --no-open

test: check unit

test-all: TESTS =
test-all: check unit

check: $(VENV)/.test
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# every worker is a process of its own: more threads than that only wait for each other
unit: $(VENV)/.test
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n auto --dist worksteal $(TESTS)

docs: $(VENV)/.docs
	$(BIN)/python -m sphinx -W -q -c docs -b html . build/docs

bench: $(VENV)/.bench
	$(BIN)/python benchmarks/run.py

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/.demo: pyproject.toml constraints.txt | $(BIN)/python
	$(PIP) install --quiet -c constraints.txt -e '.[step,vision]'
	touch $@

$(VENV)/.test: pyproject.toml constraints.txt | $(BIN)/python
	$(PIP) install --quiet -c constraints.txt -e '.[step,vision,viewer,test,docs]'
	touch $@

$(VENV)/.docs: pyproject.toml constraints.txt | $(BIN)/python
	$(PIP) install --quiet -c constraints.txt -e '.[vision,plot,docs]'
	touch $@

$(VENV)/.bench: pyproject.toml constraints.txt | $(BIN)/python
	$(PIP) install --quiet -c constraints.txt -e '.[step,vision,test,bench]'
	touch $@

clean:
	rm -rf $(VENV) build dist
