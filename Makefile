# Every target makes what it needs. The first run sets up .venv: ROS 2 from PyPI, canbase (editable), tests and checks.
.DEFAULT_GOAL := help
SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DELETE_ON_ERROR:

PYTHON ?= python3
VENV   := .venv

# Only the environment's own ROS 2 counts here, also in a terminal where another one is sourced.
unexport AMENT_PREFIX_PATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH LD_LIBRARY_PATH PYTHONPATH PYTHONHOME RMW_IMPLEMENTATION
# Bytecode is kept: hundreds of processes that the tests start would each compile canbase anew.
unexport PYTHONDONTWRITEBYTECODE
export PATH := $(CURDIR)/$(VENV)/bin:$(PATH)

.PHONY: help
help: ## show the targets
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /  make \1\t/' | expand -t 22

.PHONY: demo
demo: $(VENV)/ready ## the whole chain on a simulated bus: drives 1 m, refuses a goal, cancels a goal
	canbase demo

.PHONY: quick
quick: $(VENV)/ready ## under a minute: ruff, mypy, and the unit tests that import what changed since the last commit; BASE=main since another
	ruff check -q .
	ruff format -q --check .
	mypy
	@tests=$$(BASE=$(or $(BASE),HEAD) python virtual_bus_tests/changed_tests.py); \
	  if [[ -n $$tests ]]; then pytest -q -x --numprocesses auto $$tests; else echo "no unit test imports what changed"; fi

.PHONY: test
test: test-own-time test-real-time ## all tests: pure units, simulated drives on a bus, processes over DDS

TESTS := virtual_bus_tests

.PHONY: test-own-time
test-own-time: coverage ## tests that bring their own time: pure units, campaign, small worlds
	@echo "about 30 minutes on two processors; make quick: under one, for what changed"
	pytest --numprocesses auto --timeout 600 $(addprefix --ignore=,$(DECIDES)) $(TESTS)/unit $(TESTS)/campaign $(TESTS)/small_worlds

.PHONY: test-real-time
test-real-time: $(VENV)/ready ## tests in real time; WORKERS=2 two robots at a time; ONLY=bus simulated drives on a bus, ONLY=ros processes over DDS
	@echo "about 25 minutes, mostly waiting; half of that with WORKERS=2"
	pytest --reruns 1 --numprocesses $(or $(WORKERS),1) --dist $(if $(WORKERS),loadfile,load) $(addprefix $(TESTS)/,$(or $(ONLY),bus ros))

.PHONY: test-root
test-root: $(VENV)/ready ## the tests that need root, which every other user's run skips: sudo make test-root
	PYTHONDONTWRITEBYTECODE=1 pytest -m needs_root -p no:cacheprovider $$(grep -rl --include='test_*.py' mark.needs_root $(TESTS))

# COMPILED=1: campaign, stops and soak run with their hot modules compiled, several times as fast, frame by frame the same.
WORLD := $(if $(COMPILED),$(CURDIR)/build/compiled:)$(CURDIR)/virtual_bus_tests
WORLD_READY := $(VENV)/ready $(if $(COMPILED),build/compiled/ready)

.PHONY: campaign
campaign: $(WORLD_READY) ## 10,000 robots with overlapping faults in virtual time; SCENARIOS=500 fewer, SEED=7 tells one
ifdef SEED
	PYTHONPATH=$(WORLD) python -m campaign --seed $(SEED)
else
	PYTHONPATH=$(WORLD) python -m campaign $(if $(SCENARIOS),--scenarios $(SCENARIOS))
endif

.PHONY: nightly
nightly: $(VENV)/ready ## seeds of today that never ran: campaign, lies, odd drives, ordinary driving, explain, Hypothesis; DATE=2026-12-01 repeats a night, SHARE=0.1 a part of it
	PYTHONPATH=$(CURDIR)/virtual_bus_tests python -m campaign.nightly $(if $(DATE),--date $(DATE)) $(if $(SHARE),--share $(SHARE)) $(if $(ONLY),--only $(ONLY))

HOT_SOURCES := $(wildcard can_config/canbase_config/*.py runtime/*/*.py driver/canbase_driver/*.py \
  driver/canbase_driver/*/*.py velocity_mux/canbase_velocity/*.py \
  watchdog/canbase_watchdog/*.py action_server/canbase_action_server/*.py virtual_bus_tests/canbase_sim/*.py \
  virtual_bus_tests/canbase_sim/*/*.py virtual_bus_tests/canbase_campaign/*.py virtual_bus_tests/compiled/*.py)

build/compiled/ready: $(VENV)/ready $(HOT_SOURCES)
	PYTHONPATH=$(CURDIR)/virtual_bus_tests python -m compiled
	@touch $@

.PHONY: compiled
compiled: build/compiled/ready ## compiles the hot modules by mypyc into build/compiled: campaign, stops and soak take COMPILED=1

.PHONY: compiled-wheel
compiled-wheel: $(VENV)/ready ## a wheel for a robot, its deciding modules compiled by mypyc: dist/canbase-…-1compiled-….whl
	PYTHONPATH=$(CURDIR)/virtual_bus_tests python -m compiled.wheel

.PHONY: same-frames
same-frames: build/compiled/ready ## SEEDS=10 scenarios and robots, interpreted and compiled: every frame the same, to the last bit
	PYTHONPATH=$(CURDIR)/virtual_bus_tests python -m compiled.same $(if $(SEEDS),--seeds $(SEEDS)) $(if $(FIRST),--first $(FIRST))

.PHONY: teeth
teeth: $(VENV)/ready ## takes one safeguard out after the other; the campaign has to find it missing; ONLY=filter:estop one
	PYTHONPATH=$(CURDIR)/virtual_bus_tests python -m campaign.teeth --write $(ONLY)

.PHONY: hazard-cases
hazard-cases: $(WORLD_READY) ## the stated times of hazards on ROBOTS=20 drawn robots, straight on, on curves and in place; FIRST=20 other ones, ONLY=force some
	PYTHONPATH=$(WORLD) python -m campaign.hazard_cases $(if $(ROBOTS),--robots $(ROBOTS)) $(if $(FIRST),--first $(FIRST)) $(if $(ONLY),--only $(ONLY))

.PHONY: worst
worst: $(WORLD_READY) ## the worst speed, turn and load of failures that hide below a threshold: docs/stop_times.md; ONLY=encoder prints some; ROWS=1 each stated time beside the worst found
	PYTHONPATH=$(WORLD) python -m campaign.worst $(if $(ROWS),--rows) $(if $(ONLY),--only '$(ONLY)',--write docs/stop_times.md)

.PHONY: stops
stops: $(WORLD_READY) ## p50, p99 and max of each stop and each lie in virtual time: docs/stop_times.md; ONLY=encoder runs some
	PYTHONPATH=$(WORLD) python -m campaign.stops --write docs/stop_times.md --only '$(ONLY)'

.PHONY: kinds
kinds: $(WORLD_READY) ## each kind of drive without its masters, in virtual time: docs/stop_times.md, docs/drives/
	PYTHONPATH=$(WORLD) python -m campaign.kinds --write docs/stop_times.md
	PYTHONPATH=$(WORLD) python -m campaign.drive_pages

.PHONY: soak
soak: $(WORLD_READY) ## HOURS=20 of ordinary driving of random robots in virtual time: nothing may trip; SEED=7 tells one; LOADED=1 double payload on slopes
	PYTHONPATH=$(WORLD) python -m campaign.soak $(if $(SEED),--seed $(SEED)) $(if $(HOURS),--hours $(HOURS)) $(if $(FIRST),--first $(FIRST)) $(if $(LOADED),--loaded)

.PHONY: odd
odd: $(WORLD_READY) ## N=2000 robots with odd but legal drives: each drives 1 m, or what its message names cures it; SEED=7 tells one, ONLY=coasts,soft_stop draws from some
	PYTHONPATH=$(WORLD) python -m campaign.odd $(if $(SEED),--seed $(SEED)) $(if $(N),--robots $(N)) $(if $(FIRST),--first $(FIRST)) $(if $(ONLY),--only $(ONLY))

.PHONY: small-worlds
small-worlds: $(VENV)/ready ## every failure with every action of an operator in small worlds; FAULTS=2 deeper, EVERY=1 denser
	PYTHONPATH=$(CURDIR)/virtual_bus_tests python -m small_worlds $(if $(FAULTS),--faults $(FAULTS)) $(if $(OPERATOR),--operator $(OPERATOR)) $(if $(EVERY),--every $(EVERY))

.PHONY: fuzz
fuzz: $(VENV)/ready ## a million random and malformed frames and leases against driver, watchdog and drives
	PYTHONPATH=$(CURDIR)/virtual_bus_tests python -m campaign.fuzz

UNIT = $(TESTS)/unit
DECIDES = $(UNIT)/watchdog $(patsubst %,$(UNIT)/driver/test_%.py,cia402 axis stall release_test state_machine state_machine_way_down fault_reset standstill braking) \
  $(UNIT)/chain/test_layouts_agree.py $(UNIT)/runtime/test_latch_record.py

.PHONY: evidence-tests
evidence-tests: $(VENV)/ready ## all tests that hazards.yaml names, into build/evidence_tests.xml for canbase prove evidence --tests; about an hour
	mkdir -p build
	pytest --numprocesses auto --timeout 600 --junitxml build/evidence_tests_own_time.xml $(addprefix $(TESTS)/,unit campaign)
	CANBASE_EXIT_MATRIX=all CANBASE_CALIBRATE=1 pytest --junitxml build/evidence_tests_real_time.xml $(addprefix $(TESTS)/,bus ros)

.PHONY: coverage
coverage: $(VENV)/ready ## units of what decides about stops, with their branch coverage: all of it, or it fails
	rm -f $(VENV)/coverage*
	coverage run --data-file=$(VENV)/coverage -m pytest -q --numprocesses auto $(DECIDES)
	coverage combine -q --data-file=$(VENV)/coverage
	coverage report --data-file=$(VENV)/coverage

.PHONY: mutation
mutation: $(VENV)/ready ## mutants of watchdog policy and CiA 402 tables, of changed modules; ALL=1 of all of them
	PYTHONPATH=$(CURDIR)/virtual_bus_tests python -m mutation $(if $(ALL),--all)

.PHONY: exit-matrix
exit-matrix: $(VENV)/ready ## every way out of a driving robot, for real, measured: docs/stop_times.md; ONLY=watchdog runs some
	PYTHONPATH=$(CURDIR)/virtual_bus_tests python -m exit_matrix --write docs/stop_times.md --only '$(ONLY)'

.PHONY: bench-quick
bench-quick: $(VENV)/ready ## benchmarks of less than a minute; names what is slower than benchmarks/kept.json says
	canbase prove benchmark --quick --compare benchmarks/kept.json

.PHONY: bench
bench: $(VENV)/ready ## every budget of this computer, measured beside a floor: docs/performance.md; NAME=reaction runs one
ifdef NAME
	canbase prove benchmark $(NAME)
else
	canbase prove benchmark --write docs/performance.md --ratios benchmarks/kept.json
endif

.PHONY: pictures
pictures: $(VENV)/ready ## the pictures of docs/web.md, explain.md and qualify.md, from the tests in a real browser
	@mkdir -p build/pictures docs/pictures
	CANBASE_PICTURES=$(CURDIR)/build/pictures pytest -q $(TESTS)/bus/test_explain_page.py $(TESTS)/bus/test_qualification_page.py $(TESTS)/bus/test_evidence_page.py $(TESTS)/ros/test_web.py
	for picture in $$(grep -ho '\(web\|explain\|qualify\|evidence\)_[a-z_]*\.png' docs/web.md docs/explain.md docs/qualify.md); do cp build/pictures/$$picture docs/pictures; done

.PHONY: hazards
hazards: $(VENV)/ready ## checks hazards.yaml, writes docs/hazards.md and the ten rows of docs/safety.md
	PYTHONPATH=$(CURDIR)/virtual_bus_tests python -m hazards

.PHONY: refusals
refusals: $(VENV)/ready ## the table of docs/refusals.md: what the boot says when a drive refuses an object
	PYTHONPATH=$(CURDIR)/virtual_bus_tests python -m campaign.refusals

.PHONY: drive-pages
drive-pages: $(VENV)/ready ## docs/drives/KIND.md: what the boot writes, how each kind of drive stops, and values without a source
	PYTHONPATH=$(CURDIR)/virtual_bus_tests python -m campaign.drive_pages

.PHONY: structure
structure: $(VENV)/ready ## docs/states.svg: the states of the driver; measured figures in the sentences of pages
	PYTHONPATH=$(CURDIR)/docs python -m site_builder

.PHONY: recording
recording: $(VENV)/ready ## docs/demo.svg: what `canbase demo` prints now
	PYTHONPATH=$(CURDIR)/docs python -m site_builder.recording

.PHONY: docs
docs: $(VENV)/ready ## the documentation as a site in build/site, without network; a dead link or a warning fails
	sphinx-build --quiet --jobs auto --fail-on-warning --keep-going -c docs/site_builder -d build/doctrees docs build/site
	@echo "open build/site/index.html"

.PHONY: lint
lint: $(VENV)/ready ## ruff, oxlint (JavaScript), mypy, import rules, and that colcon sees a ROS 2 package
	ruff check .
	ruff format --check .
	oxlint --deny-warnings .
	mypy
	lint-imports --no-logo
	@found=$$(colcon --log-base /dev/null list); echo "$$found"; [[ $$found == *"(ros.ament_cmake)" ]]

.PHONY: release-check
release-check: $(VENV)/ready ## version, changelog entry, sdist and wheel, and the wheel tried in a fresh environment
	.ci/release-check

.PHONY: vm-test
vm-test: $(VENV)/ready ## a Linux guest with systemd and CAN: killed, unplugged, frozen; SCENARIOS=driver runs some; COMPILED=1 the compiled wheel
	COMPILED=$(COMPILED) virtual_bus_tests/vm/build.sh
	python virtual_bus_tests/vm/host.py $(SCENARIOS)

.PHONY: clean
clean: ## remove what make and the tools created
	rm -rf $(VENV) build docs/generated install log dist .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# ---- the environment -------------------------------------------------------------------------------------------------

INTERFACES := $(wildcard interfaces/*/*.action interfaces/*/*.msg interfaces/*/*/*.msg interfaces/*/*/*.action)

$(VENV)/made:
	@missing=$$(.ci/missing $(PYTHON)); [[ -z $$missing ]] \
	  || { echo "canbase cannot be built here yet. Install first: sudo apt-get install $$missing" >&2; exit 1; }
	@$(PYTHON) -c 'import platform, sys; exit(not ((3, 10) <= sys.version_info < (3, 14) and platform.machine() == "x86_64"))' \
	  || { echo "PyPI has ROS 2 for Python 3.10 to 3.13 on x86-64. Choose one: make PYTHON=python3.12 demo" >&2; exit 1; }
	rm -rf $(VENV)
	$(PYTHON) -m venv $(VENV)
	python -m pip install --quiet --upgrade 'pip>=25.1'
	@touch $@

# All that pyproject.toml asks for, what builds canbase too: CMake then runs in the environment itself, which is faster
# than in pip's own copy, and colcon works as well.
define REQUIREMENTS
from pip._vendor import tomli
file = tomli.load(open("pyproject.toml", "rb"))
project = file["project"]
print(*file["build-system"]["requires"], *project["dependencies"], *project["optional-dependencies"]["ros"], sep="\n")
endef
export REQUIREMENTS

$(VENV)/requirements: pyproject.toml Makefile $(VENV)/made
	@python -c "$$REQUIREMENTS" > $@.txt
	python -m pip install --quiet --requirement $@.txt --group dev
	@touch $@

# Pins and hashes of all that a robot installs, for every supported Python; no host of a registry stands in them.
LOCK := uv pip compile --no-config --quiet --upgrade --universal --python-version 3.10 --generate-hashes --no-annotate \
  --custom-compile-command 'make lock'

# What a user adds to it: a list for each extra, with the versions of the others.
EXTRAS := evidence explain metrics record web
define EXTRA
import sys
from pip._vendor import tomli
print(*tomli.load(open("pyproject.toml", "rb"))["project"]["optional-dependencies"][sys.argv[1]], sep="\n")
endef
export EXTRA

.PHONY: lock
lock: $(VENV)/requirements ## renews deploy/requirements: what a robot installs, with hashes
	python -m pip install --quiet 'uv>=0.9'
	$(LOCK) --extra gpio --no-emit-package numpy pyproject.toml --output-file deploy/requirements/ros_apt.txt
	$(LOCK) --extra gpio --extra ros pyproject.toml $(VENV)/requirements.txt --output-file deploy/requirements/ros_pypi.txt
	for extra in $(EXTRAS); do python -c "$$EXTRA" $$extra | $(LOCK) --constraint deploy/requirements/ros_apt.txt \
	  --constraint deploy/requirements/ros_pypi.txt --output-file deploy/requirements/$$extra.txt - || exit 1; done

$(VENV)/ready: $(VENV)/requirements CMakeLists.txt package.xml $(INTERFACES) $(wildcard deploy/systemd/* deploy/launch/* deploy/bin/*)
	python -m pip install --quiet --no-deps --no-build-isolation --config-settings build-dir=$(VENV)/build --editable .
	@touch $@
