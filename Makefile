# make demo | test | test-all | test-wheel | check | bench
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
export PIP_DISABLE_PIP_VERSION_CHECK := 1

.PHONY: demo test test-all test-wheel check bench system clean

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --upgrade "pip>=24"

# Rebuilt when the dependencies or the plugin's source change.
$(VENV)/installed: pyproject.toml constraints.txt CMakeLists.txt mecanum_env/plugin/mecanum_wheel.c | $(BIN)/python
	$(BIN)/pip install --quiet -c constraints.txt -e ".[dev]"
	touch $@
