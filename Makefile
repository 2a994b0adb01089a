.DEFAULT_GOAL := help
SHELL := bash
.PHONY: help setup demo test lock clean

help:            ## list the targets
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:[^#]*##/\t/' | expand -t 16

setup:           ## install and build (demo and test do it themselves)
	@tools/setup.sh

lock:            ## resolve requirements.in into requirements.txt
	@tools/lock.sh

clean:           ## remove everything that was built or installed
	rm -rf .venv build ros_ws/build ros_ws/install ros_ws/log
