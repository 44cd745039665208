# One entry for everything. Each target makes what it needs first: the virtual environment .venv, at the versions of uv.lock.
#   make demo      a body from a range of motion, then a walk solved, judged and filmed (needs no ROS)
#   make test      the tests that protect, the live graph on ROS 2's wheels included: some minutes
#   make test-all  those and the long ones: fault campaign, browser, shared recordings, studies, more of the live graph
#   make test-ros  the launch file under the real ros2 launch, in a workspace built by colcon: 5 minutes
#   make test-slurm  studies on a real Slurm of one node, which make test-all includes where Slurm is installed: 10 minutes
#   make readers   exports opened in Blender, OpenSim and USD, which make test leaves out: 1.5 GB to install
#   make faults    everything that a user can give is damaged; what comes of it is counted
#   make lint      ruff, mypy, and hadolint for the Dockerfile
#   make kernels  compile the numerical kernels anew after a change of one; the targets above do it by themselves
#   make docs      the pages of docs/ as a site: out/site/index.html
#   make figures   the table that nothing may worsen: accuracy, speed, memory; QUICK=1 for its main rows in 3 minutes
#   make bench     CPU time of each stage of the pipeline
#   make latency   time from images to their joint state in the live graph
#   make endure    time and memory of the solver over 10 minutes
#   make clean     remove what the others made
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
UV := uv==0.13.9
# Compiled at once: where Python may not write bytecode, every start of a process would compile numpy and all others.
SYNC := UV_PROJECT_ENVIRONMENT=$(VENV) $(BIN)/uv sync --quiet --frozen --inexact --compile-bytecode
# What CMake needs to find ROS 2's wheels.
FOR_ROS = VIRTUAL_ENV="$(CURDIR)/$(VENV)" AMENT_PREFIX_PATH="$(CURDIR)/$(VENV)" CMAKE_PREFIX_PATH="$(CURDIR)/$(VENV)" \
	PATH="$(CURDIR)/$(BIN):$$PATH"
DEMO := out/demo
READERS := .venv-readers
KERNELS := $(shell find bodycam_ros -name "*_kernels.py") bodycam_ros/camera/readout.py compile_kernels.py
# For this machine's processor; a wheel is for all since 2013.
export BODYCAM_KERNELS_CPU ?= native

# .venv is complete in itself: a sourced ROS installation or PYTHONPATH must not reach into it.
unexport PYTHONPATH AMENT_PREFIX_PATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH LD_LIBRARY_PATH VIRTUAL_ENV
export PYTHONNOUSERSITE := 1
# A company's proxy signs with a certificate that is in the system's store alone. uv takes that store by the variable;
# the pip that installs uv is Python's own, and before 24.2 it takes a file only: Debian's, unless another is set.
export UV_SYSTEM_CERTS ?= 1
PIP_CERT ?= $(firstword $(REQUESTS_CA_BUNDLE) $(SSL_CERT_FILE) $(wildcard /etc/ssl/certs/ca-certificates.crt))

.PHONY: help demo test test-all test-ros test-slurm figures readers faults lint kernels docs bench latency endure clean
.DELETE_ON_ERROR:

help:
	@sed -n 's/^#   make/make/p' $(MAKEFILE_LIST)

demo: $(VENV)/runtime.stamp
	mkdir -p $(dir $(DEMO))
	@echo "1. a body of a range of motion: pelvis, left leg and right thigh, by the 4 cameras that bags/rom carries"
	$(BIN)/bodycam body bags/rom/bag --map bags/map --rig bags/rom/rig.yaml -o $(dir $(DEMO))legs.yaml --force
	@echo "2. a walk with 16 cameras, solved with bags/body.yaml: that body has all the segments that they are on"
	$(BIN)/bodycam replay bags/sample/bag --map bags/map --body bags/body.yaml -o $(DEMO) --force
	@echo "3. how good is it?"
	$(BIN)/bodycam evaluate $(DEMO) --truth bags/sample --recording bags/sample/bag -o $(DEMO)_report
	@echo "4. a film of it"
	$(BIN)/bodycam film $(DEMO) --map bags/map --view orbit -o $(DEMO).mp4 --force
	@echo "look at $(DEMO)_report/summary.png first, then at $(DEMO).mp4 and $(dir $(DEMO))legs.html; '$(BIN)/bodycam' alone shows the way on"

# A worker that is killed fails the run at once; xdist would replace it and may then wait for ever.
PYTEST = $(BIN)/python -m pytest --numprocesses=auto --dist=loadfile --max-worker-restart=0 --durations=10

test: $(VENV)/ros.stamp
	$(PYTEST) -m "not long"

test-all: $(VENV)/ros.stamp
	$(PYTEST)

# Needs ROS 2 Jazzy, or ../shared/ros/real_ros2.sh, which makes .venv-ros.
test-ros:
	bash test_ros/run.sh

# Skips, with the reason, where Slurm is not installed: sudo apt install slurm-wlm munge
test-slurm: $(VENV)/ros.stamp
	$(BIN)/python -m pytest -rs test/study/test_slurm.py

readers: $(VENV)/ros.stamp $(READERS)/blender.stamp $(READERS)/readers.stamp
	$(BIN)/python -m pytest test/formats/test_readers.py

faults: $(VENV)/ros.stamp
	$(BIN)/python test/faults

lint: $(VENV)/ros.stamp
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/hadolint --config .hadolint.yaml Dockerfile

kernels: $(VENV)/runtime.stamp

# Pictures of docs/show.md, each by the command that it shows.
SHOWN = $(BIN)/bodycam film $(DEMO) --map bags/map --recording bags/sample/bag --size 1280x720 --force -o $@
docs/show/follow.jpg: VIEW = --view follow --from 1.75
docs/show/camera.jpg: VIEW = --view camera:foot_right --beside foot_right --from 1
docs/show/beside.jpg: VIEW = --view follow --beside head --from 1
docs/show/photo.jpg: VIEW = --view photo:ref_0048 --from 0.5
docs/show/road.jpg: VIEW = --environment road --travel 1 --from 1
SHOW := $(addprefix docs/show/,follow.jpg camera.jpg beside.jpg photo.jpg road.jpg)
$(SHOW): $(wildcard bodycam_ros/film/*.py bodycam_ros/environment/*.py) Makefile | $(DEMO)/metadata.yaml
	mkdir -p $(@D)
	$(SHOWN) $(VIEW)

$(DEMO)/metadata.yaml: | $(VENV)/runtime.stamp
	$(BIN)/bodycam replay bags/sample/bag --map bags/map --body bags/body.yaml -o $(DEMO) --force

docs: $(VENV)/docs.stamp $(SHOW)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

figures: $(VENV)/ros.stamp
	$(BIN)/python -m benchmarks.figures $(if $(QUICK),--quick) $(FIGURES)

bench: $(VENV)/runtime.stamp
	$(BIN)/python -m benchmarks.stage_timing bags/sample/bag --map bags/map --body bags/body.yaml

latency: $(VENV)/ros.stamp
	$(BIN)/python -m benchmarks.latency bags/sample/bag --map bags/map --body bags/body.yaml

endure: $(VENV)/runtime.stamp
	$(BIN)/python -m benchmarks.endurance bags/sample/bag --map bags/map --body bags/body.yaml

clean:
	rm -rf bodycam_ros/compiled_kernels.* $(VENV) .venv-ros $(READERS) build install log out *.egg-info msg_defs/build .mypy_cache .pytest_cache .ruff_cache

# A stamp says that the step before it is done for the present state of the files it depends on.
$(VENV)/python.stamp:
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' || \
		{ echo "bodycam_ros needs Python 3.11 to 3.13, not $$($(PYTHON) --version 2>&1); choose one: make PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || \
		{ echo "$(PYTHON) cannot make virtual environments; install them: sudo apt install python3-venv" >&2; exit 1; }
	rm -rf $(VENV)
	$(PYTHON) -m venv $(VENV)
	$(if $(PIP_CERT),PIP_CERT="$(PIP_CERT)") $(BIN)/python -m pip install --quiet --disable-pip-version-check $(UV)
	@touch $@

$(VENV)/runtime.stamp: $(VENV)/python.stamp pyproject.toml uv.lock setup.py $(KERNELS)
	@command -v cc >/dev/null && $(BIN)/python -c 'import os, sysconfig; os.stat(sysconfig.get_path("include") + "/Python.h")' 2>/dev/null || \
		{ echo "compiling the kernels needs a C compiler and Python's headers: sudo apt install build-essential python3-dev" >&2; exit 1; }
	$(SYNC) --extra film --extra study --reinstall-package bodycam_ros
	$(BIN)/python -m compileall -q bodycam_ros
	@touch $@

# The site needs nothing of ours.
$(VENV)/docs.stamp: $(VENV)/python.stamp uv.lock
	$(SYNC) --only-group docs
	@touch $@

$(VENV)/ros.stamp: $(VENV)/runtime.stamp $(wildcard msg_defs/msg/*.msg msg_defs/*.* msg_defs/*_msgs/*.*)
	@command -v c++ >/dev/null || { echo "building bodycam_msgs needs a C++ compiler; install one: sudo apt install g++" >&2; exit 1; }
	$(SYNC) --group test --group ros
	$(FOR_ROS) $(BIN)/uv pip install --quiet --no-build-isolation --no-deps ./msg_defs ./msg_defs/tf2_msgs ./msg_defs/foxglove_msgs
	@touch $@

# Not a part of .venv: Blender's numpy is another, and both are larger than all the rest.
$(READERS)/%.stamp: $(VENV)/python.stamp uv.lock
	UV_PROJECT_ENVIRONMENT=$(READERS)/$* $(BIN)/uv sync --quiet --frozen --only-group $*
	@touch $@
