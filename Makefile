.DEFAULT_GOAL := help
SHELL := bash
.PHONY: help setup demo test check nightly lock clean
RECORDING ?=
DEMO_SECONDS ?= 60
run = . ./env.sh &&

help:            ## list the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*##/\t/' | expand -t 16

setup:           ## install and build (demo and test do it themselves)
	@tools/setup.sh

demo: setup      ## play a recording through the live graph (RECORDING=m1l|isas_walk1|generated, DEMO_SECONDS=60)
	@$(run) mine-loc demo --recording "$(RECORDING)" --seconds "$(DEMO_SECONDS)"

test: setup      ## all checks: style, types, unit, live graph and fault tests
	@$(run) ruff format --check --quiet src tests && ruff check src tests && mypy && pytest

check: setup     ## style and types only
	@$(run) ruff format --check --quiet src tests && ruff check src tests && mypy

nightly: setup   ## the tests with ten million random bytes for the decoders
	@$(run) MINE_LOC_FUZZ_BYTES=10000000 pytest tests/fuzz

lock: setup      ## resolve requirements.in into requirements.txt
	@tools/lock.sh

clean:           ## remove everything that was built or installed
	rm -rf .venv build ros_ws/build ros_ws/install ros_ws/log
