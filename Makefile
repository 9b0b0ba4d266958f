# Two commands do everything on a fresh machine with Python (3.11 or later) and make:
#   make demo   the story: an image, a few readings, an answer with its spread, a report
#   make test   lint, types, contracts and tests
# make test-all runs the slow tests, too: the statistics over many scenes.
# make docs makes the site in build/docs; make core builds the compiled core anew, and nothing else.
PYTHON ?= python3
VENV   ?= .venv
BIN     = $(VENV)/bin
TESTS   = -m "not slow"
PIP     = $(BIN)/python -m pip --disable-pip-version-check

# the core is built with tools in $(VENV), in a folder that stays, so that building again compiles only what changed
CORE    = CMakeLists.txt $(wildcard src/tanteo/_core/*.cpp src/tanteo/_core/*.hpp)
EDIT    = $(PIP) install --quiet -c constraints.txt --no-build-isolation -Cbuild-dir=$(VENV)/core -e
SITE    = $(shell $(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("platlib"))')

.PHONY: demo test test-all check unit docs bench core clean

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

core: $(VENV)/.tools
	test -f $(VENV)/core/build.ninja || $(EDIT) . --no-deps
	$(BIN)/cmake --build $(VENV)/core
	$(BIN)/cmake --install $(VENV)/core --prefix $(SITE)

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/.tools: constraints.txt | $(BIN)/python
	$(PIP) install --quiet -c constraints.txt scikit-build-core nanobind cmake ninja
	touch $@

$(VENV)/.demo: pyproject.toml $(CORE) $(VENV)/.tools
	$(EDIT) '.[step,vision]'
	touch $@

$(VENV)/.test: pyproject.toml $(CORE) $(VENV)/.tools
	$(EDIT) '.[step,vision,viewer,test,docs]'
	touch $@

$(VENV)/.docs: pyproject.toml $(CORE) $(VENV)/.tools
	$(EDIT) '.[vision,plot,docs]'
	touch $@

$(VENV)/.bench: pyproject.toml $(CORE) $(VENV)/.tools
	$(EDIT) '.[step,vision,test,bench]'
	touch $@

clean:
	rm -rf $(VENV) build dist
