.DEFAULT_GOAL := help
SHELL := bash
export PYTEST_DEBUG_TEMPROOT = $(CURDIR)/build
.PHONY: help setup demo test check nightly bench bench-sim bench-uwb bench-los bench-pdr bench-fusion bench-coarse bench-live bench-recorder \
    bench-replay bench-store lock clean
RECORDING ?=
DEMO_SECONDS ?= 60
SITE ?=
PEOPLE ?= 3
run = . ./env.sh &&

help:            ## list the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*##/\t/' | expand -t 16

setup:           ## install and build (demo and test do it themselves)
	@tools/setup.sh

demo: setup      ## the live graph on a recording (RECORDING=m1l|isas_walk1|generated) or a simulated SITE=config/…
	@$(run) mine-loc demo --recording "$(RECORDING)" --seconds "$(DEMO_SECONDS)" \
	    $(if $(SITE),--site "$(SITE)") --people "$(PEOPLE)"

test: setup      ## all checks: style, types, unit, live graph and fault tests
	@$(run) ruff format --check --quiet src tests bench examples && ruff check src tests bench examples && mypy \
	    && pytest --numprocesses auto tests/unit && pytest --ignore tests/unit

check: setup     ## style and types only
	@$(run) ruff format --check --quiet src tests bench examples && ruff check src tests bench examples && mypy

nightly: setup   ## ten million random bytes for the decoders, ten minutes of ten people, an hour of one in a replay
	@$(run) MINE_LOC_FUZZ_BYTES=10000000 pytest tests/fuzz
	@$(run) MINE_LOC_SIM_SECONDS=600 pytest --timeout 600 tests/unit/mine_loc_sim/test_byte_streams.py
	@$(run) MINE_LOC_SOAK_SECONDS=3600 pytest tests/replay/test_soak.py

bench: setup     ## every bench, under 75 minutes on two cores, and docs/results.md from it
	@$(run) python bench/all.py

bench-sim: setup ## the simulator against its models and real data (bench/results/sim.json)
	@$(run) python bench/sim.py

bench-uwb: setup ## the UWB solvers against papers, recordings and libraries (bench/results/uwb.json)
	@$(run) python bench/uwb.py

bench-los: setup ## the LOS/NLOS classifier on placements and scenes it never saw (bench/results/los.json)
	@$(run) python bench/los.py

bench-pdr: setup ## dead reckoning on recordings of waists and phones (bench/results/pdr.json)
	@$(run) python bench/pdr.py

bench-fusion: setup ## fusion against paper A, its rivals and GTSAM (bench/results/fusion.json)
	@$(run) python bench/fusion.py

bench-coarse: setup ## coarse regions in paper E's setting, with rivals (bench/results/coarse.json)
	@$(run) python bench/coarse.py

bench-live: setup ## latency, fleets and load of the live graph on two cores (bench/results/live.json)
	@$(run) python bench/live.py

bench-replay: setup ## simulated mines from bytes to poses, and the speed of a replay (bench/results/replay.json)
	@$(run) python bench/replay.py

bench-recorder: setup ## recorders killed under load, cost and rate, the player's punctuality (bench/results/recorder.json)
	@$(run) python bench/recorder.py

bench-store: setup ## cost of a row and times of questions on ten million rows (bench/results/store.json)
	@$(run) python bench/store.py

lock: setup      ## resolve requirements.in into requirements.txt
	@tools/lock.sh

clean:           ## remove everything that was built or installed
	rm -rf .venv build ros_ws/build ros_ws/install ros_ws/log
