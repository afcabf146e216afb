# The front door.  `make` lists the targets.
#
# This file decides what is set up and in which order; tools/native.mk and tools/stm32.mk compile the C code.
# Variables: PYTHON, CC (gcc), CLANG (clang-14), FLAVOUR (release), JOBS (all cores), EXPERIMENT, PYTEST_ARGS, VEHICLE, GEAR, SIL_ARGS,
# FUZZ_RUNS, FUZZ_ARGS, VISION_ARGS, CAD_ARGS, WHEEL_ARGS, PACKETS_ARGS.

PYTHON     ?= python3
CLANG      ?= clang-14
FLAVOUR    ?= release
JOBS       ?= $(shell getconf _NPROCESSORS_ONLN)
EXPERIMENT ?= experiments/paper_flight.yaml
SWEEP      ?= sweeps/smoke.yaml
FUZZ_RUNS  ?= 5000000
ifeq ($(origin CC),default)
CC := $(if $(shell command -v gcc),gcc,cc)
endif
export CC CLANG
# every program of the tests loads the package: it is compiled once, not by each of them
unexport PYTHONDONTWRITEBYTECODE

VENV   := .venv
BIN    := $(VENV)/bin
UNITY  := build/unity
GOLDEN := release O0 clang clang-O0
STM32  := stm32-Os stm32-O2 stm32-clang
# a -j given by the user is passed on; without one the C code is compiled on all cores
SUBMAKE = $(MAKE) --no-print-directory $(if $(filter -j%,$(MAKEFLAGS)),,-j$(JOBS)) -Otarget
NATIVE  = $(SUBMAKE) -f tools/native.mk
CROSS   = $(SUBMAKE) -f tools/stm32.mk
APP     = $(SUBMAKE) -f tools/app.mk
say     = @printf '==> %s\n'
# what is no test of pytest or Unity, both of which end a test that does not, ends after this
within  = timeout --verbose --kill-after=10 3600
# most of what is installed is never loaded: Python compiles what is
pip     = $(BIN)/python -m pip --disable-pip-version-check install --quiet --no-compile --constraint tools/constraints.txt

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
ifndef SIDE_BY_SIDE
.NOTPARALLEL:
endif

##@ Start here

.PHONY: help
help: ## list the targets
	@awk -f tools/help.awk $(firstword $(MAKEFILE_LIST))

.PHONY: setup
setup: $(VENV)/.stamp-run ## create .venv with the package `ivl` and what it needs to run

.PHONY: build
build: ## compile firmware core and simulator into the library that Python loads, and the software vehicle
	$(say) 'build: compiling firmware core and simulator ($(FLAVOUR))'
	@+$(NATIVE) FLAVOUR=$(FLAVOUR) lib sil

.PHONY: sil
sil: setup build ## start the software vehicle on udp://127.0.0.1:19850, with the world of EXPERIMENT or VEHICLE=... GEAR=... (SIL_ARGS='--speed 10')
	@$(BIN)/ivl sil $(if $(VEHICLE)$(GEAR),$(if $(VEHICLE),--vehicle $(VEHICLE)) $(if $(GEAR),--gear $(GEAR)),--experiment $(EXPERIMENT)) $(SIL_ARGS)

.PHONY: learn
learn: setup build ## learn the paper's landing on the vehicle that agrees with real flights (EXPERIMENT=... for another)
	$(say) 'learn: $(EXPERIMENT)'
	@$(BIN)/ivl learn $(EXPERIMENT)

.PHONY: sweep
sweep: setup build ## a few cells of the paper's campaign (SWEEP=sweeps/paper.yaml for all of it)
	$(say) 'sweep: $(SWEEP)'
	@$(BIN)/ivl sweep $(SWEEP)

.PHONY: figs
figs: setup build ## the paper's figures 4 to 9 from RUN=... (a sweep's run folder, or several)
	$(say) 'figs: $(RUN)'
	@test -n '$(RUN)' || { echo 'figs: say which run, for example: make figs RUN=runs/paper-as_simulated-bo'; exit 2; }
	@$(BIN)/ivl figs $(RUN)

.PHONY: vision
vision: setup build ## pictures of an onboard camera, rendered and estimated: how wrong its cues are (VISION_ARGS='--approaches 400 --json')
	$(say) 'vision: surfaces, light and lenses'
	@$(BIN)/ivl camera table $(VISION_ARGS)

.PHONY: cad
cad: setup build openscad ## legs and jigs to print, as STL in build/cad (CAD_ARGS='--gear-set mine.yaml --gear wide'; tools/cad.py --help)
	$(say) 'cad: models of cad/ with the numbers of the gear file'
	@$(BIN)/python tools/cad.py $(CAD_ARGS)

##@ To give away

.PHONY: wheel
wheel: setup-dev toolchain ## wheels in build/wheels that need no compiler: for this processor, and for aarch64
	@tools/apt_install.sh aarch64-linux-gnu-gcc:gcc-aarch64-linux-gnu :libc6-dev-arm64-cross
	$(say) 'wheel: compiling and packing'
	@JOBS=$(JOBS) $(BIN)/python tools/wheel.py
	@JOBS=$(JOBS) $(BIN)/python tools/wheel.py --machine aarch64

.PHONY: test-wheel
test-wheel: setup-dev build ## the wheels in fresh environments without compiler and repository; aarch64 under qemu-user (WHEEL_ARGS='--python python3.13')
	@tools/apt_install.sh aarch64-linux-gnu-gcc:gcc-aarch64-linux-gnu :libc6-dev-arm64-cross qemu-aarch64:qemu-user
	$(say) 'test-wheel: installed, and used'
	@$(within) $(BIN)/python tools/test_wheel.py $(WHEEL_ARGS)
	$(say) 'test-wheel: aarch64, emulated'
	@$(within) $(BIN)/python tools/test_wheel.py --machine aarch64

.PHONY: example-cpp
example-cpp: golden-build-O0 ## the flight core in a bare C loop and in a C++ module, compiled and flown (docs/PORTING.md)
	@tools/apt_install.sh $(CPP)
	$(say) 'example-cpp: examples'
	@+$(NATIVE) FLAVOUR=O0 examples

.PHONY: docs
docs: setup-dev build ## the documentation as web pages in build/docs/html, with the reference generated from the package
	$(say) 'docs: pages, warnings as errors'
	@$(within) $(BIN)/python tools/docs/build.py

.PHONY: notebook
notebook: setup-dev build ## run the tutorial as a notebook, with its figures, into build/notebook
	$(say) 'notebook: docs/TUTORIAL.md, cell by cell'
	@$(within) $(BIN)/python tools/notebook.py --check  # examples/tutorial.ipynb is what the page gives

##@ The vehicle's processor

.PHONY: firmware
firmware: $(STM32:%=firmware-%) ## compile flight core and Crazyflie app for the STM32F405 and print their sizes
	@+$(CROSS) FLAVOUR=stm32-Os install
	$(say) 'firmware: flight core, bytes of flash'
	@for flavour in $(STM32); do \
	    printf '  %-12s ' $$flavour; arm-none-eabi-size --totals build/$$flavour/firmware/core/*.o | awk 'END {print $$1}'; done
	$(say) 'firmware: Crazyflie app, compiled with the flags of its SDK'
	@+$(APP) objects

.PHONY: $(STM32:%=firmware-%)
$(STM32:%=firmware-%): firmware-%: cross-toolchain
	$(say) 'firmware: compiling $*'
	@+$(CROSS) FLAVOUR=$* programs

.PHONY: pil
pil: setup-dev build firmware pil-unity-stm32-Os ## unit tests, replay and landings on an emulated STM32F405
	@+$(CROSS) layout
	$(say) 'pil: pytest tests/stm32'
	@$(BIN)/python -m pytest tests/stm32 $(PYTEST_ARGS)

.PHONY: $(STM32:%=pil-unity-%)
$(STM32:%=pil-unity-%): pil-unity-%: firmware-% $(UNITY)/unity.c
	$(say) 'pil: C tests on the emulated chip ($*)'
	@+$(CROSS) FLAVOUR=$* check

.PHONY: pil-long
pil-long: setup-dev build firmware $(STM32:%=pil-unity-%) ## unit tests of each build, a million recorded ticks of each compared, ten million fuzzed (4 min)
	$(say) 'pil-long: replay'
	@$(BIN)/python tools/stm32/replay.py --ticks 1000000 $(STM32:%=build/%/replay.elf)
	$(say) 'pil-long: fuzz'
	@+$(CROSS) fuzz

.PHONY: sizes
sizes: setup-dev build firmware ## flash, memory, stack, instructions and cycles of a tick
	$(say) 'sizes: figures and budgets'
	@$(BIN)/python tools/stm32/budget.py $(STM32:%=build/%)

.PHONY: sizes-diff
sizes-diff: setup-dev build firmware ## the same against the accepted figures; fails on growth beyond a margin
	$(say) 'sizes-diff: figures, budgets and tools/stm32/baseline.json'
	@$(within) $(BIN)/python tools/stm32/budget.py --diff $(STM32:%=build/%)

.PHONY: sizes-update
sizes-update: setup-dev build firmware ## accept the present figures (in a commit that says why)
	$(say) 'sizes-update: tools/stm32/baseline.json'
	@$(BIN)/python tools/stm32/budget.py --update $(STM32:%=build/%)

##@ Tests

# Two at a time: the first compile while pip waits for its downloads, then the longest come first.  Stages that compile into one folder are
# ordered by their prerequisites.  test-wire flies in real time, beside stages of one process each.
TESTS := setup-dev test-c golden lint test-py pil test-links san test-forms test-sil test-mutants test-sweep test-report sizes-diff \
         test-mujoco test-analysis test-flight test-vision
QUIET := docs notebook test-physics

.PHONY: test
test: ## everything below, set-up and compilers included
	@tools/apt_install.sh $(TOOLCHAIN) $(CPP) $(CROSS_TOOLCHAIN) $(VISION_TOOLCHAIN) $(FUZZER) $(QT_LIBRARIES) $(CHROMIUM) $(OPENSCAD)
	$(say) 'test: two at a time, each printed when it is over'
	@+$(MAKE) --no-print-directory -j2 -Otarget SIDE_BY_SIDE=1 $(TESTS)
	@+$(MAKE) --no-print-directory -j2 -Otarget SIDE_BY_SIDE=1 test-wire test-quiet
	$(say) 'test: everything passed'

.PHONY: test-quiet
test-quiet: ## stages of one process each, one after the other
	@+for stage in $(QUIET); do $(MAKE) --no-print-directory -Onone $$stage || exit 1; done

.PHONY: test-c
test-c: toolchain build $(UNITY)/unity.c example-cpp ## unit tests of firmware core and simulator (Unity), and the examples in C and C++
	$(say) 'test-c: C tests, strict warnings as errors'
	@+$(NATIVE) FLAVOUR=release check
	$(say) 'test-c: Crazyflie app on a stand-in for its SDK, ASan and UBSan'
	@+$(APP) check
	$(say) 'test-c: random sequences of events for the app'
	@+$(APP) sequences

.PHONY: san-build
san-build: toolchain
	$(say) 'san: compiling with ASan and UBSan'
	@+$(NATIVE) FLAVOUR=san lib sil

.PHONY: san
san: san-build setup-dev $(UNITY)/unity.c ## the same C tests, and landings, under AddressSanitizer and UndefinedBehaviorSanitizer
	$(say) 'san: C tests under ASan and UBSan'
	@+$(NATIVE) FLAVOUR=san check
	$(say) 'san: random sequences for the server of the software vehicle'
	@+$(NATIVE) FLAVOUR=san sequences
	$(say) 'san: landings under ASan and UBSan'
	@LD_PRELOAD=$$($(CC) -print-file-name=libasan.so) ASAN_OPTIONS=detect_leaks=0 IVL_NATIVE_LIBRARY=build/san/libivl_sil.so \
	    $(BIN)/python -m pytest -p no:cacheprovider -m 'not slow' tests/physics $(PYTEST_ARGS)

.PHONY: golden
golden: setup-dev $(GOLDEN:%=golden-build-%) ## same bits from gcc and clang, -O0 and -O3, any registers, one thread or many
	$(say) 'golden: hashes of reference landings'
	@$(within) $(BIN)/python tools/golden.py $(GOLDEN:%=build/%/libivl_sil.so)

.PHONY: golden-update
golden-update: setup-dev $(GOLDEN:%=golden-build-%) ## accept the present hashes as the reference (in its own commit, with the reason)
	$(say) 'golden-update: tests/golden/landings.txt'
	@$(BIN)/python tools/golden.py --update $(GOLDEN:%=build/%/libivl_sil.so)

.PHONY: $(GOLDEN:%=golden-build-%)
$(GOLDEN:%=golden-build-%): golden-build-%: toolchain build
	$(say) 'golden: compiling $*'
	@+$(NATIVE) FLAVOUR=$* lib

.PHONY: test-py
test-py: setup-dev build ## tests of the Python package
	$(say) 'test-py: pytest tests/py'
	@$(BIN)/python -m pytest tests/py $(PYTEST_ARGS)

.PHONY: test-flight
test-flight: setup-dev build ## recorded flights: every form of log there and back, damaged files, folders of flights
	$(say) 'test-flight: pytest tests/flight'
	@$(BIN)/python -m pytest tests/flight $(PYTEST_ARGS)

.PHONY: test-sil
test-sil: setup-dev build san-build qt-libraries ## the software vehicle with unmodified cflib, and a short fuzz of its packets
	@tools/apt_install.sh $(FUZZER)
	@+$(NATIVE) FLAVOUR=fuzz fuzz
	$(say) 'test-sil: pytest tests/sil'
	@$(BIN)/python -m pytest tests/sil $(PYTEST_ARGS)

.PHONY: fuzz
fuzz: toolchain setup build ## fuzz the packets of the software vehicle (FUZZ_RUNS=5000000 inputs; FUZZ_ARGS for libFuzzer)
	@tools/apt_install.sh $(FUZZER)
	@+$(NATIVE) FLAVOUR=fuzz fuzz
	$(say) 'fuzz: $(FUZZ_RUNS) inputs; new ones are kept in build/fuzz/corpus'
	@tools/fuzz.sh build/fuzz/fuzz_crtp $(FUZZ_RUNS) $(FUZZ_ARGS)

.PHONY: test-links
test-links: setup-dev build ## flying over a link: the same bits as in process, lost packets, restarts, rehearsal as a drone
	$(say) 'test-links: pytest tests/links'
	@$(BIN)/python -m pytest tests/links $(PYTEST_ARGS)

.PHONY: mutants
mutants: setup-dev build toolchain $(UNITY)/unity.c ## small faults put into the product, and how many of them the tests find; writes docs/RELIABILITY.md (an hour)
	$(say) 'mutants: one fault at a time'
	@$(BIN)/python tools/mutants.py $(MUTANTS_ARGS)

.PHONY: test-mutants
test-mutants: setup-dev test-c ## a few of these faults, each of which must be found
	$(say) 'test-mutants: a few small faults'
	@$(within) $(BIN)/python tools/mutants.py --only wire --only mocap --scale 0.07

.PHONY: sequences
sequences: toolchain $(UNITY)/unity.c ## random sequences for the app, and for the software vehicle's server (SEQUENCES=20000 SEED=1)
	@+$(APP) sequences SEQUENCES=$(or $(SEQUENCES),20000) SEED=$(or $(SEED),1)
	@+$(NATIVE) FLAVOUR=san sequences SEQUENCES=$(or $(SEQUENCES),20000) SEED=$(or $(SEED),1)

.PHONY: reliability
reliability: setup-dev build toolchain $(UNITY)/unity.c ## damaged files, failing disks, hostile packets, links that lose and restart; writes docs/RELIABILITY.md (hours)
	@+$(APP) build/app/sequences
	@+$(NATIVE) FLAVOUR=san build/san/loop_sequences
	@tools/apt_install.sh $(FUZZER)
	@+$(NATIVE) FLAVOUR=fuzz fuzz
	@$(BIN)/python tools/packets.py $(PACKETS_ARGS)
	@mkdir -p build/borders
	@$(CC) -std=c11 -O1 -Wall -Wextra -Werror -shared -fPIC -o build/borders/faulty_io.so tools/faulty_io.c -ldl
	@LD_PRELOAD=$(CURDIR)/build/borders/faulty_io.so IVL_FAULTY_IO=$(CURDIR)/build/borders/faulty_io.so \
	    $(BIN)/python tools/borders.py
	@$(BIN)/python tools/reliability.py

# which C tests know of forms; the image of the chip is that of `ivl learn --uri pil://`
FORMS_TESTS    := test_ivl_policy test_ivl_parts test_ivl_wire test_ivl_fuzz
FORMS_ON_STM32 := test_ivl_policy test_ivl_parts

.PHONY: test-forms
test-forms: setup-dev test-c firmware pil-unity-stm32-Os ## forms of a policy that no product file knows: learned, swept, reported, flown everywhere
	$(say) 'test-forms: library, software vehicle, image and app with the forms of tests/forms, and their C tests'
	@+$(NATIVE) FORMS=tests/forms lib sil $(FORMS_TESTS:%=run-%)
	@+$(CROSS) FORMS=tests/forms build/stm32-Os-tests-forms/tick_server.elf $(FORMS_ON_STM32:%=run-%)
	@+$(APP) FORMS=tests/forms check objects
	$(say) 'test-forms: pytest tests/forms'
	@$(BIN)/python -m pytest tests/forms $(PYTEST_ARGS)

.PHONY: test-wire
test-wire: setup-dev build ## CRTP over a CAN bus, and motion capture
	$(say) 'test-wire: pytest tests/wire'
	@$(BIN)/python -m pytest tests/wire $(PYTEST_ARGS)

.PHONY: test-physics
test-physics: setup-dev build ## landings with known properties, and a sample of the step-size study
	$(say) 'test-physics: pytest tests/physics'
	@$(BIN)/python -m pytest tests/physics $(PYTEST_ARGS)

.PHONY: test-report
test-report: setup-dev build chromium openscad ## reports and the live view in a real browser, exports and printable models read back
	$(say) 'test-report: pytest tests/report tests/live tests/cad'
	@$(BIN)/python -m pytest tests/report tests/live tests/cad $(PYTEST_ARGS)

.PHONY: step-study
step-study: setup-dev build ## ten thousand landings with shorter and shorter steps (2 min)
	@$(BIN)/python tests/physics/step_study.py

.PHONY: ends-study
ends-study: setup-dev build ## does every landing end? ten million of random vehicles (an hour or two)
	@$(BIN)/python tests/physics/ends_study.py

.PHONY: test-mujoco
test-mujoco: setup-dev build ## landings compared with an independent engine
	$(say) 'test-mujoco: pytest tests/mujoco'
	@$(BIN)/python -m pytest tests/mujoco $(PYTEST_ARGS)

.PHONY: test-sweep
test-sweep: setup-dev build ## sweeps on real processes: workers, clients and cells that fail, the same tables every time
	$(say) 'test-sweep: pytest tests/sweep'
	@$(BIN)/python -m pytest tests/sweep $(PYTEST_ARGS)

.PHONY: test-vision
test-vision: setup-dev build ## cues from pictures: a sample of `make vision`, a reference in floating point, other processors, a short fuzz
	@tools/apt_install.sh $(VISION_TOOLCHAIN) $(FUZZER)
	@+$(SUBMAKE) -f tools/vision.mk
	@+$(NATIVE) FLAVOUR=fuzz build/fuzz/fuzz_vision
	$(say) 'test-vision: pytest tests/vision'
	@$(BIN)/python -m pytest tests/vision $(PYTEST_ARGS)

.PHONY: test-analysis
test-analysis: setup-dev build ## analysis and figures of campaigns, on tables with known answers
	$(say) 'test-analysis: pytest tests/analysis'
	@$(BIN)/python -m pytest tests/analysis $(PYTEST_ARGS)

.PHONY: lint
lint: setup-dev build golden-build-O0 ## formatting, types, rules of the firmware core, equation references
	$(say) 'lint: ruff'
	@$(BIN)/ruff check
	@$(BIN)/ruff format --check
	$(say) 'lint: mypy --strict'
	@$(BIN)/mypy --strict host/ivl
	$(say) 'lint: clang-format'
	@$(BIN)/clang-format --dry-run -Werror $(C_FILES) < /dev/null
	$(say) 'lint: rules of the firmware core'
	@tools/check_core.sh build/O0/firmware/core build/release/firmware/core
	$(say) 'lint: equation references'
	@$(BIN)/python tools/check_refs.py
	$(say) 'lint: docs/PARAMS.md is what the table of parameters gives'
	@$(BIN)/python tools/params.py --check

##@ Work

.PHONY: format
format: setup-dev ## format C and Python in place
	$(say) 'format: ruff, clang-format'
	@$(BIN)/ruff check --fix-only --quiet
	@$(BIN)/ruff format
	@$(BIN)/clang-format -i $(C_FILES) < /dev/null

.PHONY: bench
bench: setup-dev build firmware ## rollouts and steps per second per core, ratio to MuJoCo, emulated STM32 and UDP against real time, Gymnasium, sweeps on 1 and 2 cores
	$(say) 'bench'
	@$(BIN)/ivl bench --pil --udp --gym
	$(say) 'bench: sweeps, overhead of a task, and what follows for larger machines'
	@$(BIN)/python tools/scaling.py

.PHONY: setup-dev
setup-dev: $(VENV)/.stamp-dev ## add what tests and lint need to .venv

# what is installed, for tools/apt_install.sh
TOOLCHAIN       := $(firstword $(CC)):gcc nm:binutils $(CLANG):clang-14
CPP             := g++:g++
CROSS_TOOLCHAIN := arm-none-eabi-gcc:gcc-arm-none-eabi qemu-system-arm:qemu-system-arm $(CLANG):clang-14 \
    $$(echo '\#include <string.h>' | arm-none-eabi-gcc -E -x c - > /dev/null 2>&1 || echo :libnewlib-arm-none-eabi)
VISION_TOOLCHAIN := riscv64-unknown-elf-gcc:gcc-riscv64-unknown-elf aarch64-linux-gnu-gcc:gcc-aarch64-linux-gnu arm-none-eabi-gcc:gcc-arm-none-eabi
FUZZER          := $(CLANG):clang-14 $$(tools/has_fuzzer.sh $(CLANG) || echo :libclang-rt-14-dev)
CHROMIUM        := chromium:chromium
OPENSCAD        := openscad:openscad
QT_LIBRARIES    := libdbus-1.so.3:libdbus-1-3 libEGL.so.1:libegl1 libfontconfig.so.1:libfontconfig1 libGL.so.1:libgl1 \
    libglib-2.0.so.0:libglib2.0-0 libxkbcommon.so.0:libxkbcommon0

.PHONY: toolchain
toolchain: ## install the compilers that the tests need (Debian; needs root only if one is missing)
	@tools/apt_install.sh $(TOOLCHAIN)

.PHONY: cross-toolchain
cross-toolchain: ## install what compiles for the vehicle and emulates it (Debian; needs root only if something is missing)
	@tools/apt_install.sh $(CROSS_TOOLCHAIN)

.PHONY: chromium
chromium: ## install the browser that the reports are tested in (Debian; needs root only if it is missing)
	@tools/apt_install.sh $(CHROMIUM)

.PHONY: openscad
openscad: ## install the program that makes the printable models (Debian; needs root only if it is missing)
	@tools/apt_install.sh $(OPENSCAD)

.PHONY: qt-libraries
qt-libraries: ## install what cfclient's windows are drawn with (Debian; needs root only if something is missing)
	@tools/apt_install.sh $(QT_LIBRARIES)

.PHONY: clean
clean: ## remove what was compiled
	$(say) 'clean: build/, native library, caches'
	@rm -rf build host/ivl/_native/*.so host/ivl/_native/*.elf host/ivl/_native/ivl_sil .mypy_cache .pytest_cache .ruff_cache .hypothesis

.PHONY: distclean
distclean: clean ## remove .venv as well
	$(say) 'distclean: $(VENV)'
	@rm -rf $(VENV) host/*.egg-info

C_FILES = $(wildcard firmware/core/*.[ch] firmware/app/*.[ch] firmware/vision/*.[ch] firmware/stm32f405/*.[ch] sim_sil/*.[ch] sim_sil/physics/*.[ch] sim_sil/world/*.[ch] sim_sil/camera/*.[ch] sim_sil/pil/*.[ch] sim_sil/cf/*.[ch] sim_sil/cf/sdk/*.h sim_sil/crtp/*.[ch] tests/c/*.[ch] tests/crtp/*.[ch] tests/forms/*.[ch] tests/fuzz/*.c tests/stm32/*.c tools/vision/*.c tools/vision/include/*.h tests/app/*.[ch] firmware/sdk/*.h tools/*.c examples/*.c examples/*.h examples/*.cpp)

# set-up, each step once

$(BIN)/python:
	$(say) 'setup: creating $(VENV)'
	@PYTHON='$(PYTHON)' tools/make_venv.sh $(VENV)

$(VENV)/.stamp-run: $(BIN)/python pyproject.toml tools/constraints.txt
	$(say) 'setup: installing ivl and what it needs'
	@$(pip) --editable '.[link,sweep,report,live,video]'
	@touch $@

# what is needed to run is a part of it, and is not installed twice
$(VENV)/.stamp-dev: $(BIN)/python pyproject.toml tools/constraints.txt
	$(say) 'setup: installing ivl and what it, its tests and lint need'
	@$(pip) --editable '.[link,sweep,report,live,video,gym,optimisers,cluster,rerun,cfclient,test,mujoco,lint,stm32,docs,notebook]'
	@touch $(VENV)/.stamp-run $@

$(UNITY)/unity.c: tools/get_unity.sh tools/unity.txt | $(BIN)/python
	$(say) 'setup: installing Unity, the C test framework'
	@tools/get_unity.sh $(BIN)/python $(UNITY)
