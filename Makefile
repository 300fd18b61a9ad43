# Everything from a plain Python 3.10 to 3.13 with venv, and make. `make PYTHON=python3.12 test` takes another Python.
PYTHON ?= python3
VENV   ?= .venv
OUT    ?= out

BIN    := $(VENV)/bin
PIP    := $(BIN)/python -m pip --disable-pip-version-check
STAMP  := $(VENV)/.signlin_ros_installed
PEERS  := $(VENV)/.signlin_ros_peers_installed
PAGES  := $(VENV)/.signlin_ros_docs_installed
SHARED := pyproject.toml constraints.txt package.xml $(wildcard config/* config/launch/* ros_bin/*)

export PIP_NO_INPUT = 1
export FASTRTPS_DEFAULT_PROFILES_FILE = $(abspath config/fastdds_profile.xml)

.PHONY: help install test test-all quick limits check lint types imports bytecode format docs demo demo-live demo-experiment soak workbench bench clean
.DEFAULT_GOAL := help

help:            ## this list
	@sed -n 's/^\([a-z-]*\):.*## */\1	/p' $(MAKEFILE_LIST) | expand -t 12

install: $(STAMP)  ## the environment $(VENV) with everything in it

$(BIN)/python:
	@$(PYTHON) -c 'import sys; v = sys.version_info; sys.exit(0 if (3, 10) <= v < (3, 14) else 1)' || { \
	  echo "Python 3.10 to 3.13 is needed; $(PYTHON) is $$($(PYTHON) --version 2>&1)." \
	       "Name another one: make PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { \
	  echo "$(PYTHON) has no venv. On Debian and Ubuntu: apt-get install" \
	       "$$($(PYTHON) -c 'import sys; print("python%d.%d-venv" % sys.version_info[:2])')" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)

# The wheels of ROS 2 carry build tools of their own, so pip's notes go to a file; it is shown where the install fails.
$(STAMP): $(SHARED) | $(BIN)/python
	@echo "Installing into $(VENV) (some minutes the first time) ..."
	@$(PIP) install -q -c constraints.txt -e '.[all,dev]' > $(VENV)/install.log 2>&1 || { cat $(VENV)/install.log >&2; exit 1; }
	@$(BIN)/signlin warm >> $(VENV)/install.log 2>&1 || { tail -n 3 $(VENV)/install.log >&2; exit 1; }
	@touch $@

$(PEERS): $(STAMP)
	@$(PIP) install -q -c constraints.txt -e '.[bench]' > $(VENV)/install_peers.log 2>&1 || { cat $(VENV)/install_peers.log >&2; exit 1; }
	@touch $@

$(PAGES): $(STAMP)
	@$(PIP) install -q -c constraints.txt -e '.[docs]' > $(VENV)/install_docs.log 2>&1 || { cat $(VENV)/install_docs.log >&2; exit 1; }
	@touch $@

# Tests run side by side, two more than there are processors, since those with ROS and those with a browser mostly wait:
# `make test WORKERS=0` runs them one after the other. `make test TESTS=tests/unit` runs some of them.
WORKERS ?= $(shell expr $$(nproc 2>/dev/null || echo 2) + 2)
TESTS   ?= tests docs/learn
test test-all quick: export OPENBLAS_NUM_THREADS ?= 1
# Hundreds of processes are started: each would compile every module anew where Python is told to keep no bytecode.
test test-all quick bytecode: export PYTHONDONTWRITEBYTECODE :=
quick: WORKERS = logical
# The cells of the others are run, once, where what they come to is looked at (tests/notebooks.py).
NOTEBOOKS = --nbmake $(addprefix --ignore=docs/learn/,$(addsuffix .ipynb,motor damper simulator))
PYTEST = $(BIN)/python -m pytest -q -p no:anyio -n $(WORKERS) --maxprocesses=8 --dist=loadgroup --no-loadscope-reorder

test: install    ## lint, types, import rules and the tests, but for those that take long
	@$(MAKE) --no-print-directory -j2 $(CHECKS) bytecode
	$(PYTEST) $(NOTEBOOKS) -m 'not long and not limit' $(TESTS) $(PYTEST_ARGS)

test-all: install  ## the same with the tests that take long
	@$(MAKE) --no-print-directory -j2 $(CHECKS) bytecode
	$(PYTEST) $(NOTEBOOKS) -m 'not limit' $(TESTS) $(PYTEST_ARGS)

limits: install  ## the known failures (docs/limitations.md), strictly: one that has been mended shows here
	$(PYTEST) -m limit $(PYTEST_ARGS)

quick: install   ## lint, and the tests that need neither time, nor a browser, nor ROS: under 90 s
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(PYTEST) -m 'not slow and not ros and not limit' $(addprefix --ignore=tests/,diagnosis web ros independent) $(PYTEST_ARGS)

CHECKS = types imports lint
check: install   ## lint, types and import rules only
	@$(MAKE) --no-print-directory -j2 $(CHECKS)

lint: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: install
	$(BIN)/mypy

imports: install
	$(BIN)/lint-imports

# Tests are compiled with their assertions taken apart: once, beside the checks, not by every worker at once.
bytecode: install
	@$(BIN)/python -m pytest -q -p no:anyio --collect-only $(TESTS) > /dev/null 2>&1 || true  # the tests say why

format: install  ## let ruff repair what it can
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

demo: install    ## the main job for real: simulator and linearizer over ROS 2, a figure and a table
	$(BIN)/python -m signlin_ros.demo --output $(OUT)

workbench: install  ## the local page, with a sample record
	$(BIN)/signlin workbench --sample

demo-live: install  ## a model watched, diagnosed and improved while the machine runs: a figure over time
	$(BIN)/python -m signlin_ros.demo.live --output $(OUT)

demo-experiment: install  ## a tie, the record that decides it, played over ROS 2, and the verdict
	$(BIN)/python -m signlin_ros.demo.experiment --output $(OUT)

demo-arm: install  ## an arm with hidden friction in one joint: named, added, and the error falls, over ROS 2
	$(BIN)/python -m signlin_ros.demo.arm --output $(OUT)/arm

soak: install    ## the faults of the fault harness for an hour: lost, late, repeated, corrupted messages, restarts
	SIGNLIN_SOAK=3600 $(BIN)/python -m pytest -q tests/ros/test_faults.py

docs: $(PAGES)   ## the documentation site into $(OUT)/site, internal links strict, nothing fetched
	$(BIN)/python docs/make_results.py
	$(BIN)/mkdocs build --strict

bench: $(PEERS)  ## speed and latency, as ratios against other tools
	$(BIN)/python benchmarks/bench.py

clean:           ## all that make has made, but not $(VENV)
	rm -rf $(OUT) .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache dist build
	find . -name __pycache__ -not -path './$(VENV)/*' -prune -exec rm -rf {} +
