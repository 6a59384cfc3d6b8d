# Every target sets itself up: a machine needs Python 3.11 or newer with venv, make and a package index.
# The environment is made again only when a lock file or pyproject.toml changes.

VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check
# The first of these that is 3.11 or newer; `make PYTHON=...` overrules.
PYTHON ?= python3 python3.13 python3.12 python3.11 python

RUN := $(VENV)/.run
DEV := $(VENV)/.dev
BUILT := build/kernels.sha256

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:

.PHONY: help
help:  ## This list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-10s %s\n", $$1, $$2 }' $(firstword $(MAKEFILE_LIST))

.PHONY: demo
demo: $(RUN) bytecode  ## Calibrate the recording that ships with the package
	$(BIN)/tumble demo

.PHONY: kernels
kernels: $(RUN)  ## Build the compiled loops anew where their sources have changed
	$(BIN)/python setup.py -q build_ext --inplace

.PHONY: wheel
wheel: $(RUN)  ## Build a wheel for this platform and Python into dist
	$(PIP) wheel --quiet --no-deps --no-build-isolation -w dist .

WHEELS := manylinux_2_28_x86_64 manylinux_2_28_aarch64 macosx_11_0_x86_64 macosx_11_0_arm64

.PHONY: wheels
wheels: $(RUN)  ## Build wheels for Linux and macOS, x86-64 and ARM, every Python from 3.11 on, into dist
	$(PIP) install --quiet --require-hashes -r requirements/compiler.txt
	for tag in $(WHEELS); do TUMBLE_WHEEL=$$tag $(PIP) wheel --quiet --no-deps --no-build-isolation -w dist . || exit 1; done

.PHONY: test
test: $(DEV) bytecode  ## Run what a change needs; `make test ARGS="tests/laws -x"` runs some
	$(BIN)/python -m pytest -n auto --dist loadfile -m "not slow" $(ARGS)

.PHONY: test-slow
test-slow: $(DEV) bytecode  ## Run what `make test` leaves out: recovery, statistics, the papers' studies
	TUMBLE_CHECK_SHAPES= $(BIN)/python -m pytest -n auto --dist loadfile -m slow $(ARGS)

.PHONY: test-all
test-all: test test-slow  ## Run every test

# The readers and writers, and the tests that are about them. What is reached by whole calibrations alone is not counted.
COVERED := src/tumble/files,src/tumble/recording/formats,src/tumble/export,src/tumble/document
COVERING := tests/contract/test_f*.py tests/contract/test_t*.py \
            tests/unit/files tests/unit/recording tests/unit/document tests/unit/export tests/fuzz \
            tests/laws/test_calibration_document.py \
            tests/cli/test_convert.py tests/cli/test_apply_and_verify.py \
            tests/unit/workflows/test_apply.py tests/laws/test_thermal_model.py tests/faults/test_disks_that_fail.py

.PHONY: coverage
coverage: $(DEV) bytecode  ## Measure the branches of readers and writers that tests take (some minutes)
	$(BIN)/python -m coverage run --branch --source=$(COVERED) -m pytest -q -n 0 -m "not slow" $(COVERING)
	$(BIN)/python -m coverage report --skip-covered

.PHONY: fuzz
fuzz: $(DEV) bytecode  ## Try 20,000 changed files and calls, 200 kills, failing disks (an hour of one core)
	$(BIN)/python -m tests.fuzz --cases 20000
	$(BIN)/python -m tests.faults --kills 200

.PHONY: lint
lint: $(DEV)  ## Check style and layout of the code (ruff), and the words of messages and pages
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/python docs/site/words.py

.PHONY: format
format: $(DEV)  ## Bring the code into layout, mending what can be mended
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

.PHONY: types
types: $(DEV)  ## Check the types (pyright, strict)
	$(BIN)/pyright --pythonpath $(BIN)/python

.PHONY: contract
contract: $(DEV)  ## Check which way imports point (import-linter)
	$(BIN)/lint-imports --no-cache

.PHONY: docs
docs: $(DEV) bytecode  ## Build the documentation's site into build/site; a warning is a failure
	$(BIN)/sphinx-build -W --keep-going -q -j auto -d build/doctrees docs build/site
	@echo "The site: build/site/index.html"

.PHONY: figures
figures: $(DEV) bytecode  ## Simulate and draw the figures of the procedures' pages anew (some minutes)
	$(BIN)/python docs/figures/expected_uncertainty.py
	$(BIN)/python docs/figures/classical_uncertainty.py
	$(BIN)/python docs/figures/noise_other_tools.py
	$(BIN)/python docs/figures/doors.py

.PHONY: map
map: $(DEV)  ## Write the floors of the house and tables of records anew
	$(BIN)/python docs/site/map_page.py

.PHONY: schema
schema: $(DEV)  ## Write the JSON schemas of calibrations, protocols and noise anew
	$(BIN)/python docs/schema/write_schema.py

# What measures speed; the others are studies of hours, which pages name.
SPEED := allan joint_speed kernels noise papers peers python_loop reading reading_formats

.PHONY: bench
bench: $(DEV) bytecode  ## Measure speed, as ratios within one run (ten minutes)
	$(PIP) install --quiet --require-hashes -r requirements/bench.txt
	@for name in $(SPEED); do echo "== $$name"; $(BIN)/python benchmarks/$$name.py || exit 1; done

.PHONY: measure
measure: $(RUN) bytecode  ## Print how large the house is, beside its ceilings and aims
	$(BIN)/python benchmarks/measure_source.py

.PHONY: lock
lock:  ## Compile requirements/ anew from pyproject.toml (needs uv)
	uv pip compile pyproject.toml --group build --group dev $(LOCK) -o requirements/dev.txt
	uv pip compile pyproject.toml --group build -c requirements/dev.txt $(LOCK) -o requirements/run.txt
	echo 'ziglang>=0.13' | uv pip compile - $(LOCK) -o requirements/compiler.txt
	echo 'numba>=0.61' | uv pip compile - -c requirements/dev.txt $(LOCK) -o requirements/bench.txt

# Hashes for every platform and Python; neither the index's address nor a path of this machine.
LOCK := --quiet --universal --python-version 3.11 --generate-hashes --no-header --no-annotate \
        --no-emit-index-url --no-emit-find-links

.PHONY: clean
clean:  ## Remove the environment and everything that was made
	rm -rf $(VENV) build dist tumble-demo .pytest_cache .ruff_cache .hypothesis .import_linter_cache .coverage
	find src tests benchmarks -name __pycache__ -prune -exec rm -rf {} +
	find src \( -name '*.so' -o -name '*.pyd' \) -delete

$(RUN): requirements/run.txt pyproject.toml
	@found=; for python in $(PYTHON); do \
	    if "$$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then found=$$python; break; fi; \
	done; \
	if [ -z "$$found" ]; then echo "No Python 3.11 or newer among: $(PYTHON). Name one: make PYTHON=..." >&2; exit 1; fi; \
	"$$found" -m venv --clear $(VENV)
	$(PIP) install --quiet --no-compile --require-hashes -r requirements/run.txt
	$(BIN)/python -m compileall -q -j 0 $(VENV)
	@cc=$$($(BIN)/python -c 'import sysconfig; print((sysconfig.get_config_var("CC") or "cc").split()[0])'); \
	if ! command -v "$$cc" >/dev/null; then \
	    $(PIP) install --quiet --require-hashes -r requirements/compiler.txt; fi
	@echo "Building the compiled loops (once)."
	$(PIP) install --quiet --no-deps --no-build-isolation -e .
	@touch $@

$(BUILT): setup.py $(shell find src -name 'kernels.p*') | $(RUN)
	$(BIN)/python setup.py -q build_ext --inplace
	@touch $@

$(DEV): requirements/dev.txt $(RUN)
	$(PIP) install --quiet --no-compile --require-hashes -r requirements/dev.txt
	$(BIN)/python -m compileall -q -j 0 $(VENV)
	@touch $@

# Python may be told not to write bytecode (PYTHONDONTWRITEBYTECODE), and then compiles at every start.
.PHONY: bytecode
bytecode: $(RUN) $(BUILT)
	@$(BIN)/python -m compileall -q src
