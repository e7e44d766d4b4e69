# `make run` flies the paper's rectangle; `make test` runs every check. Both build what they need first.

PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
READY  := $(VENV)/ready

.PHONY: run test bench docs lint setup clean

run: $(READY)
	@$(BIN)/python -m gcs_tools.demo

test: $(READY)
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy sitl
	@$(BIN)/lint-imports
	@$(BIN)/python -m pytest
	@NUMBA_DISABLE_JIT=1 $(BIN)/python -m pytest -m "not e2e and not compiled" tests/unit/model tests/unit/control tests/unit/estimation tests/validation

bench: $(READY)
	@$(BIN)/python -m benchmarks

# what real clients say and are answered, and the tables in docs/link.md that are made of it
docs: $(READY)
	@CONFORMANCE_WRITE=1 $(BIN)/python -m pytest tests/e2e/test_client_*.py
	@$(BIN)/python -m conformance

setup: $(READY)

# the environment, and the compiled kernels in the user's cache; MAVProxy comes without the 290 MB (VTK, OpenCV) that
# only its 3D map and video windows need, what else it needs is in the extra `test`
$(READY): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed, this is " + sys.version)'
	@echo "Building the environment in $(VENV) ..."
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[test]'
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt --no-deps MAVProxy
	@echo "Compiling the simulator ..."
	@$(BIN)/python -m sitl.warm
	@touch $@

clean:
	rm -rf $(VENV) build *.egg-info
