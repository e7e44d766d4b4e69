# `make run` flies the paper's rectangle; `make test` runs every check. Both build what they need first.

PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
READY  := $(VENV)/ready
TESTED := $(VENV)/ready-to-test
COMPUTED := $(VENV)/computed-tests.txt

.PHONY: run test test-flown test-computed bench docs setup clean

run: $(READY)
	@$(BIN)/python -m gcs_tools.demo

test: $(TESTED)
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy sitl
	@$(BIN)/lint-imports
	@nice -n 19 $(MAKE) --no-print-directory test-computed > $(COMPUTED) 2>&1 & computed=$$!; \
	  $(MAKE) --no-print-directory test-flown; flown=$$?; \
	  wait $$computed; computed=$$?; cat $(COMPUTED); [ $$flown = 0 ] && [ $$computed = 0 ]

# what flies in real time, and beside it, in the time that leaves, what computes; then once more without compiling
test-flown: $(TESTED)
	@$(BIN)/python -m pytest -m e2e

test-computed: $(TESTED)
	@$(BIN)/python -m pytest -m "not e2e"
	@NUMBA_DISABLE_JIT=1 $(BIN)/python -m pytest -m "not e2e and not compiled" tests/unit/model tests/unit/control tests/unit/estimation tests/validation

bench: $(TESTED)
	@$(BIN)/python -m benchmarks

# what real clients say and are answered, and the tables in docs/link.md that are made of it
docs: $(TESTED)
	@CONFORMANCE_WRITE=1 $(BIN)/python -m pytest tests/e2e/test_client_*.py
	@$(BIN)/python -m conformance

setup: $(TESTED)

# the environment, and the compiled kernels in the user's cache
$(READY): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed, this is " + sys.version)'
	@echo "Building the environment in $(VENV) ..."
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e .
	@echo "Compiling the simulator ..."
	@$(BIN)/python -m sitl.warm
	@touch $@

# what the checks need besides. MAVProxy comes without the 290 MB (VTK, OpenCV) that only its 3D map and video windows
# need, what else it needs is in the extra `test`. The page's tests need a Chromium; where there is none they are
# left out and say so
$(TESTED): $(READY)
	@echo "Adding what the checks need ..."
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[test]'
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt --no-deps MAVProxy
	@command -v chromium >/dev/null || [ "$$(id -u)" != 0 ] || ! command -v apt-get >/dev/null || \
	  { echo "Installing Chromium ..." && apt-get -qq update && apt-get -qq install -y chromium >/dev/null; } || true
	@touch $@

clean:
	rm -rf $(VENV) build *.egg-info
