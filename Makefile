# make demo       install everything, fit the bundled logs, find a gap and close it, film the robot: out/
# make test       install everything, run the test suite
# make test-all   the slow tests too
# make test-wheel what an installation can break, tested against the built wheel, outside the checkout
# make site       the documentation as web pages with search, out/site/index.html; a warning is an error
# make check      lint, format, types
# make bench      every benchmark, figures in out/bench/
# make bench-train  what training reaches over three seeds, half an hour
# make zoo        drives and robots drawn at random, with hidden effects: the whole table, docs/results/zoo.md
# make zoo-quick  the same with sixty cases
# make gapbench   the benchmark's folder, the answers of all methods and the leaderboard, docs/results/gapbench.md
# make fuzz       a night of mangled files for every reader
# make soak       10,000 episodes and an hour of random driving on rollers with every effect (RESETS=N MINUTES=N: less)
# make asan       the plugin and its tests under the address and undefined-behaviour sanitizers
# make behaviour  what every program computes, recorded in out/behaviour; compare two records after a change
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
APT := libosmesa6 gcc libc6-dev
export PIP_DISABLE_PIP_VERSION_CHECK := 1
# A second OpenMP thread only fights with the first on small problems.
export OMP_NUM_THREADS := 1
# Where bytecode is not kept, as in some containers, every program that a test starts compiles our modules anew.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: demo test test-all test-wheel site check bench bench-train zoo zoo-quick gapbench behaviour fuzz soak asan system clean FORCE

demo: $(VENV)/installed
	$(BIN)/mecanum demo --out out

# A file stays with one worker, so that what its tests share is computed once; tests/conftest.py says which come first.
test: $(VENV)/train
	$(BIN)/python -m pytest -n auto --dist loadfile --no-loadscope-reorder -m "not slow"

test-all: $(VENV)/train
	$(BIN)/python -m pytest -n auto --dist loadfile --no-loadscope-reorder

test-wheel: $(VENV)/installed
	$(BIN)/python tests/run_on_wheel.py

# From scratch, as a build that goes on from another hides warnings.
site: $(VENV)/train
	rm -rf out/site
	$(BIN)/python -m sphinx -W --keep-going -q -E -b html -d build/doctrees docs out/site
	@echo "wrote out/site/index.html"

check: $(VENV)/installed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: $(VENV)/train
	$(BIN)/pip install --quiet -c constraints.txt "mecanum-tankendo[peers]"
	for name in imports plugin physics paper_drives replay fit gap online render env real_logs executor peers; do \
	  $(BIN)/python benchmarks/$$name.py --out out/bench/$$name.json || exit 1; done

# An interrupted run goes on where it was.
bench-train: $(VENV)/train
	$(BIN)/python benchmarks/train.py --out out/bench/train.json

# Hours; an interrupted run goes on where it was.
zoo: $(VENV)/installed
	$(BIN)/python -m sysid.studies.zoo --settle --out out/zoo --markdown docs/results/zoo.md

zoo-quick: $(VENV)/installed
	$(BIN)/python -m sysid.studies.zoo --quick --out out/zoo

# An hour; an interrupted run goes on where it was. Recordings of one's own: REAL="--real FOLDER".
gapbench: $(VENV)/installed
	$(BIN)/pip install --quiet -c constraints.txt "mecanum-tankendo[gapbench]"
	$(BIN)/python -m sysid.studies.gapbench make --out out/gapbench $(REAL)
	$(BIN)/python -m sysid.studies.gapbench run --cases out/gapbench/cases --out out/gapbench/answers
	$(BIN)/python -m sysid.studies.gapbench leaderboard --bench out/gapbench --answers out/gapbench/answers \
	  --markdown docs/results/gapbench.md

# Six minutes; `python benchmarks/behaviour.py compare BEFORE AFTER` prints every difference.
behaviour: $(VENV)/train
	$(BIN)/python benchmarks/behaviour.py record out/behaviour

fuzz: $(VENV)/installed
	MECANUM_FUZZ=50 $(BIN)/python -m pytest -q tests/test_fuzz.py

# Half an hour; CI drives less.
RESETS := 10000
MINUTES := 60
soak: $(VENV)/installed
	$(BIN)/python tests/soak.py --resets $(RESETS) --minutes $(MINUTES)

asan: $(VENV)/installed
	$(BIN)/python tests/sanitized.py

# System packages: the offline renderer, and a compiler for the plugin.
system:
	@if ldconfig -p 2>/dev/null | grep -q libOSMesa && command -v cc >/dev/null; then :; \
	elif [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
	  apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq $(APT) >/dev/null; \
	else echo "missing system packages; run: sudo apt-get install $(APT)"; fi

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)

# The editable install knows the modules that there were, so a new or renamed one asks for another.
$(VENV)/modules: FORCE | $(BIN)/python
	@find mecanum_env sysid training mecanum_cli -name '*.py' | sort > $@.now
	@cmp -s $@.now $@ && rm $@.now || mv $@.now $@

FORCE:

# Again when the dependencies, the plugin or the set of modules change.
$(VENV)/installed: pyproject.toml constraints.txt CMakeLists.txt $(wildcard mecanum_env/plugin/*.[ch]) $(VENV)/modules | system $(BIN)/python
	$(BIN)/pip install --quiet -c constraints.txt -e ".[dev]"
	@touch $@

# Stable-Baselines3 with torch and Ray, which only training, clusters and their tests need.
$(VENV)/train: $(VENV)/installed
	$(BIN)/pip install --quiet -c constraints.txt "mecanum-tankendo[train,ray]"
	@touch $@

clean:
	rm -rf $(VENV) build dist out
