# Two commands do all the set-up: `make demo` and `make test`. Others: `make help`.
PYTHON ?= python3
VENV   := .venv
WORKERS ?= 2
BIN    := $(VENV)/bin

# set in many containers: every process would compile our sources, and every pytest rewrite the tests, anew
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help demo test compiled check fast slow-tests slow-beside-socketcan slow-after-socketcan socketcan-and-slow real-time socketcan fuzz kills safe-state debian-root bench shape wheel speed scaling proof wild wild-loader switched next-experiment resampling identification microcontroller results pages clean lock

help: ## list the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*## */\t/' | expand -t 14

$(BIN)/.run: pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "loaderhil needs Python 3.11 or newer: make PYTHON=python3.11 ..." >&2; exit 2; }
	@$(PYTHON) -c 'import ensurepip' 2>/dev/null || { echo "$(PYTHON) cannot make virtual environments: install its venv package (Debian: python3-venv)" >&2; exit 2; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[render]'
	@touch $@

$(BIN)/.test: $(BIN)/.run
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[test]'
	@touch $@

$(BIN)/.bench: $(BIN)/.test
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[bench]'
	@touch $@

demo: $(BIN)/.run ## roll-over with the ECU's limits off and on; writes out/demo/report.html
	$(BIN)/loaderhil compile
	$(BIN)/loaderhil demo --out out/demo

# User-mode Linux has one processor: beside it long computations have the other. Tests in real time run alone.
test: check fast ## every test, linter and import contract
	@echo "== long tests and SocketCAN beside each other; each prints when it is through, in some twenty minutes"
	$(MAKE) --no-print-directory --jobs=2 --output-sync=target WORKERS=1 slow-beside-socketcan socketcan-and-slow
	$(MAKE) --no-print-directory real-time

fuzz: $(BIN)/.test ## 10^5 mutated files through every reader, 10^7 frames through ECU, gateway and hub, into docs/results/fuzz.md (hours; run again to take up)
	$(BIN)/python -m tests.fuzz --report docs/results/fuzz.md $(FUZZ)

kills: $(BIN)/.bench ## kill -9 of every process of a run, 20 times each, into docs/results/kills.md (half an hour)
	$(BIN)/python -m bench.kills --out docs/results/kills.md

safe-state: compiled ## kill, unplug, bus-off, full disk, set clock, broken settings: when the machine is safe, into docs/results/safe-state.md (twenty minutes, under user-mode Linux)
	UML_TIMEOUT_S=3600 scripts/uml-run $(BIN)/python -m bench.safe_state --out docs/results/safe-state.md

DEBIAN_ROOT ?= /tmp/loaderhil-debian-root

debian-root: compiled ## the exported ECU in a clean Debian root, into docs/results/debian-root.md (minutes; needs mmdebstrap, and root)
	rm -rf $(DEBIAN_ROOT) && mkdir -p $(DEBIAN_ROOT)
	mmdebstrap --variant=minbase --include=systemd,systemd-sysv,iproute2 bookworm $(DEBIAN_ROOT)/root.tar
	tar -C $(DEBIAN_ROOT) -xf $(DEBIAN_ROOT)/root.tar --exclude='./dev/*' && rm $(DEBIAN_ROOT)/root.tar
	scripts/with-vcan $(BIN)/python -m bench.debian_root $(DEBIAN_ROOT) --out docs/results/debian-root.md

check: $(BIN)/.test ## format, lint, types, import contracts
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

compiled: $(BIN)/.test # two workers of pytest would compile the same functions, each for itself
	$(BIN)/loaderhil compile --all

# the files with these marks: to collect all of them takes half a minute
marked = $$(grep -rlE 'mark\.($(1))' tests --include='test_*.py' $(2))
# about as long as SocketCAN and the slow tests elsewhere
BESIDE_SOCKETCAN = tests/(discrepancy|identify|bench|walks)/
pytest-slow = $(BIN)/pytest -n $(WORKERS) --dist loadfile --timeout-method=thread -m 'slow and not processes and not browser'

fast: compiled ## tests that need no real time, browser or CAN in the kernel
	$(BIN)/pytest -n $(WORKERS) --dist loadfile --timeout-method=thread -m 'not processes and not browser and not socketcan and not slow'

slow-tests: compiled ## tests that compute for long
	$(pytest-slow) $(call marked,slow)

slow-beside-socketcan: compiled
	$(pytest-slow) $(call marked,slow,| grep -E '$(BESIDE_SOCKETCAN)')

slow-after-socketcan: compiled
	$(pytest-slow) $(call marked,slow,| grep -vE '$(BESIDE_SOCKETCAN)')

socketcan-and-slow: compiled
	$(MAKE) socketcan; failed=$$?; $(MAKE) slow-after-socketcan && exit $$failed

real-time: compiled ## tests with processes in real time, and in a real browser
	$(BIN)/pytest -m 'processes or browser' $(call marked,processes|browser)

# a user-mode kernel lacks the mappings to compile
socketcan: compiled ## SocketCAN tests: natively where the kernel has CAN, else under user-mode Linux
	UML_TIMEOUT_S=1800 scripts/with-vcan $(BIN)/pytest -m socketcan $(call marked,socketcan)

wheel: $(BIN)/.test ## a wheel in out/wheel that holds the machine code: what is installed from it compiles nothing (three minutes)
	rm -rf out/wheel
	$(BIN)/python scripts/build-wheel out/wheel
	$(BIN)/python scripts/check-wheel out/wheel/*.whl

bench: $(BIN)/.bench ## every benchmark, each against its peer
	@for b in $(basename $(notdir $(wildcard bench/bench_*.py))); do echo "== $$b"; $(BIN)/python -m bench.$$b || exit 1; done

shape: $(BIN)/.test ## sizes, import levels, circles and comments of the source tree
	$(BIN)/python -m bench.shape

speed: $(BIN)/.bench ## every benchmark into docs/results/speed.md, on a quiet machine alone (some ten minutes)
	$(BIN)/python -m bench.speed --out docs/results/speed.md

scaling: $(BIN)/.bench ## cost against frames, machines, recordings and workers, and what 10 000 machines need, into docs/results/scaling.md (ten minutes, quiet machine alone)
	$(BIN)/python -m bench.scaling --out docs/results/scaling.md

proof: $(BIN)/.bench ## prove the diagnosis: all arms into docs/results/proof.md (hours; run again to take up); PROOF='--arms straight --share 0.1'
	$(BIN)/python -m bench.proof --out docs/results/proof.md $(PROOF)

wild: $(BIN)/.bench ## diagnosis of truths that differ from the model in structure, into docs/results/wild.md (an hour; run again to take up); WILD='--share 0.5'
	$(BIN)/python -m bench.wild --seeds report --out docs/results/wild.md $(WILD)

wild-loader: $(BIN)/.bench ## the same of the whole loader, into docs/results/wild-loader.md (two hours; run again to take up); WILD='--share 0.2'
	LOADERHIL_EFFECTS=bench/wild_effects OPENBLAS_NUM_THREADS=1 $(BIN)/python -m bench.wild --bodies loader --seeds report --out docs/results/wild-loader.md $(WILD)

switched: $(BIN)/.bench ## faults that come and go, two in a drive, into docs/results/switched.md (half an hour)
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m bench.switched --out docs/results/switched.md

next-experiment: $(BIN)/.bench ## drives that may leave several names, and the manoeuvre that leaves one, into docs/results/next-experiment.md (a quarter of an hour)
	$(BIN)/python -m bench.next_experiment --out docs/results/next-experiment.md

resampling: $(BIN)/.bench ## whether verdicts depend on how often was sampled, into docs/results/resampling.md (half an hour)
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m bench.resampling --out docs/results/resampling.md

identification: $(BIN)/.test ## coverage of the identification on 200 seeded cases into docs/results/identification.md (an hour; run again to take up)
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m bench.identify_coverage --cases 200 --out docs/results/identification.md
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m bench.identify_machine --seeds 200 220 --out docs/results/identification-machine.md

microcontroller: $(BIN)/.test ## the exported C ECU against the Python one, and its cost on a Cortex-M4F, into docs/results/microcontroller*.md (half an hour)
	$(BIN)/python -m bench.microcontroller --out docs/results/microcontroller.md
	$(BIN)/python -m bench.microcontroller_detection --out docs/results/microcontroller-detection.md
	$(BIN)/python -m bench.microcontroller_random --out docs/results/microcontroller-random.md

results: $(BIN)/.test ## regenerate the campaigns' tables and docs/thesis (tens of minutes; results of single runs are kept)
	$(BIN)/loaderhil campaign normal-force --out docs/results || test $$? = 1 # a target missed: the page says so
	$(BIN)/loaderhil campaign roll-over --out docs/results || test $$? = 1 # a target missed: the page says so
	$(BIN)/loaderhil campaign roll-over --extended --out docs/results || test $$? = 1 # a target missed: the page says so
	$(BIN)/loaderhil campaign prevention --out docs/results || test $$? = 1 # a target missed: the page says so
	$(BIN)/loaderhil thesis all --out docs/thesis

pages: $(BIN)/.test ## regenerate the reference pages from DBC, effects, faults and the schema of findings.json
	@for s in scripts/*-docs; do $(BIN)/python $$s || exit 1; done

lock: $(BIN)/.test ## renew constraints.txt from the environment
	@{ head -n 1 constraints.txt; $(BIN)/python -m pip list --format=freeze --exclude-editable --exclude pip --exclude setuptools; } > constraints.new
	@mv constraints.new constraints.txt

clean: ## remove what was built, not the environment
	rm -rf out build *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	find . -name __pycache__ -not -path './$(VENV)/*' -type d -prune -exec rm -rf {} +
