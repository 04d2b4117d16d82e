# Every target makes what it needs. The first run sets up .venv: ROS 2 from PyPI, canbase (editable), tests and checks.
.DEFAULT_GOAL := help
SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DELETE_ON_ERROR:

PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
# Only the environment's own ROS 2 counts here, also in a terminal where another one is sourced.
FOREIGN := AMENT_PREFIX_PATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH LD_LIBRARY_PATH PYTHONPATH PYTHONHOME RMW_IMPLEMENTATION
ALONE   := env $(FOREIGN:%=-u %)
RUN     := $(ALONE) PATH="$(CURDIR)/$(BIN):$$PATH"

.PHONY: help
help: ## show the targets
	@grep -hE '^[a-z]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):.*## /  make \1\t/' | expand -t 16

.PHONY: demo
demo: $(VENV)/ready ## the whole chain on a simulated bus: drives 1 m, refuses a goal, cancels a goal
	$(RUN) canbase demo

.PHONY: test
test: $(VENV)/ready ## all tests: pure units, simulated drives on a bus, processes over DDS
	$(RUN) pytest

.PHONY: lint
lint: $(VENV)/ready ## ruff, mypy, import rules, and that colcon sees a ROS 2 package
	$(RUN) ruff check .
	$(RUN) ruff format --check .
	$(RUN) mypy
	$(RUN) lint-imports --no-logo
	found=$$($(RUN) colcon --log-base /dev/null list); echo "$$found"; [[ $$found == *"(ros.ament_cmake)" ]]

.PHONY: clean
clean: ## remove what make and the tools created
	rm -rf $(VENV) build install log dist .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# ---- the environment -------------------------------------------------------------------------------------------------

INTERFACES := $(wildcard interfaces/*/*.action interfaces/*/*.msg interfaces/*/*/*.msg)

# tool:package of Debian and Ubuntu
TOOLS := cmake:cmake make:make gcc:gcc g++:g++

$(VENV)/made:
	@missing=; for tool in $(TOOLS); do command -v "$${tool%%:*}" >/dev/null || missing+=" $${tool##*:}"; done; \
	command -v $(PYTHON) >/dev/null || missing+=" python3"; \
	$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || missing+=" python3-venv"; \
	$(PYTHON) -c 'import os, sysconfig as s; exit(not os.path.exists(s.get_path("include") + "/Python.h"))' 2>/dev/null \
	  || missing+=" python3-dev"; \
	if [ -n "$$missing" ]; then echo "Missing to build canbase. Install with: sudo apt-get install$$missing" >&2; exit 1; fi
	@$(PYTHON) -c 'import platform as p, sys; v = sys.version_info[:2]; exit(not ((3, 10) <= v <= (3, 13) and p.machine() == "x86_64"))' \
	  || { echo "ROS 2 is on PyPI for Python 3.10 to 3.13 on x86-64 only. Name such a Python: make PYTHON=python3.12 …" >&2; exit 1; }
	rm -rf $(VENV)
	$(ALONE) $(PYTHON) -m venv $(VENV)
	$(RUN) python -m pip install --quiet --upgrade 'pip>=25.1'
	@touch $@

# What pyproject.toml lists under [build-system], so that CMake runs in the environment itself: faster than pip's own
# copy, and colcon works too.
$(VENV)/requirements: pyproject.toml $(VENV)/made
	$(RUN) python -c 'from pip._vendor import tomli; print(*tomli.load(open("pyproject.toml", "rb"))["build-system"]["requires"], sep="\n")' > $@.txt
	$(RUN) python -m pip install --quiet --requirement $@.txt --group dev
	@touch $@

$(VENV)/ready: $(VENV)/requirements pyproject.toml CMakeLists.txt package.xml $(INTERFACES)
	$(RUN) python -m pip install --quiet --no-build-isolation --config-settings build-dir=$(VENV)/build --editable '.[ros]'
	@touch $@
