# Compiles firmware core, simulator and C tests.  Called by the Makefile as
#     make -f tools/native.mk FLAVOUR=<flavour> <target>
# Targets: core, lib, sil, check, sequences (random ones for the server's loop, SEQUENCES of them), fuzz (flavour fuzz only).  Everything made
# is in build/<flavour>/.
# Each source is compiled once per flavour; the library and the tests link the same objects.

FLAVOUR ?= release
CLANG   ?= clang-14

SANITIZE := -fsanitize=address,undefined,float-cast-overflow -fno-sanitize-recover=all

# the tests of `shared` link the product as libraries, so that a changed source costs one link and not one for each test
FLAVOURS           := release O0 shared san clang clang-O0 fuzz aarch64
OPTIMISE_release   := -O3 -fno-semantic-interposition
OPTIMISE_aarch64   := $(OPTIMISE_release)
OPTIMISE_O0        := -O0
OPTIMISE_shared    := -O0
OPTIMISE_san       := -O1 -g -fno-omit-frame-pointer $(SANITIZE)
OPTIMISE_clang     := -O3
OPTIMISE_clang-O0  := -O0
OPTIMISE_fuzz      := -O2 -g -fno-omit-frame-pointer $(SANITIZE)
ifeq ($(filter $(FLAVOUR),$(FLAVOURS)),)
$(error FLAVOUR=$(FLAVOUR) is not one of: $(FLAVOURS))
endif
COMPILER := $(if $(filter clang% fuzz,$(FLAVOUR)),$(CLANG),$(if $(filter aarch64,$(FLAVOUR)),aarch64-linux-gnu-gcc,$(CC)))

WARNINGS := -Wall -Wextra -pedantic -Wconversion -Wsign-conversion -Wdouble-promotion -Wfloat-equal -Wshadow -Wundef \
            -Wswitch-enum -Wcast-align -Wmissing-prototypes -Wstrict-prototypes -Werror

# no contraction: the same source gives the same bits on every machine and compiler, whatever its instructions
# the flight core also in halves, for vehicles side by side
CFLAGS := -std=c11 $(OPTIMISE_$(FLAVOUR)) -ffp-contract=off -DIVL_SIDE_BY_SIDE -fno-math-errno -fPIC -pthread \
          -Ifirmware/core -Ifirmware/vision -Isim_sil -Isim_sil/physics -Isim_sil/world -Isim_sil/camera
LDLIBS := -lm -pthread

# objects of the release flavour also carry what GCC needs to optimise library and vehicle as a whole; all others link them as they are, which
# GCC does only if it is told to
AS_THEY_ARE := -fno-lto
ifneq ($(findstring Free Software Foundation,$(shell $(CC) --version)),)
LTO_release := -flto -ffat-lto-objects
LTO_LINK_release := -flto=auto
# what is combined is not linked otherwise, so it needs no code of its own
THIN_release := -fno-fat-lto-objects
COMBINE_release = $(COMPILER) $(CFLAGS) $(LTO_LINK_release) -flinker-output=nolto-rel -nostdlib -r
endif
COMBINE = $(or $(COMBINE_$(FLAVOUR)),ld -r)

# further flags of a folder, and of a single object by its name without folder and suffix
# the simulator passes vectors by value, within one compilation only: the note that their ABI once changed is idle; it has the app's senses
FLAGS_sim_sil := -Wno-psabi -Ifirmware/app -isystem firmware/sdk
FLAGS_sim_sil/physics := $(FLAGS_sim_sil)
FLAGS_sim_sil/world := $(FLAGS_sim_sil)
FLAGS_sim_sil/camera := $(FLAGS_sim_sil)
FLAGS_sim_sil/pil := $(FLAGS_sim_sil) -Ifirmware/stm32f405

# the software vehicle: the app's own sources, with the vehicle in the place of its SDK
FLAGS_vehicle      := -isystem sim_sil/cf/sdk $(FLAGS_sim_sil) -DSDK_ON_HOST -Isim_sil/cf
FLAGS_sim_sil/cf   := $(FLAGS_vehicle)
FLAGS_firmware/app := $(FLAGS_vehicle)

# Unity is a foreign source: a system header to the tests, compiled without our warnings
UNITY         := build/unity
FLAGS_unity   := -DUNITY_INCLUDE_DOUBLE -isystem $(UNITY)
FLAGS_tests/c := $(FLAGS_unity) $(FLAGS_sim_sil) -Itests/c -Isim_sil/cf -Itests/crtp

# the link server, and a vehicle that only writes down what it is told, for its tests
FLAGS_sim_sil/crtp := $(FLAGS_sim_sil)
FLAGS_tests/crtp   := $(FLAGS_sim_sil)
FLAGS_tests/fuzz   := $(FLAGS_vehicle) $(FLAGS_unity) -Itests/c

# The fuzzer is guided by the server and the vehicle, not by the physics, which costs time and says little.  Comparisons are followed in the
# server alone: the vehicle searches its tables by name when it starts.
ifeq ($(FLAVOUR),fuzz)
FLAGS_sim_sil/crtp += -fsanitize=fuzzer-no-link
FLAGS_sim_sil/cf   += -fsanitize-coverage=inline-8bit-counters,pc-table
FLAGS_firmware/app += -fsanitize-coverage=inline-8bit-counters,pc-table
FLAGS_firmware/vision += -fsanitize=fuzzer-no-link
endif

# FORMS=folder adds forms of policies (firmware/core/ivl_form.h): its sources, and its forms.h, which only ivl_form.c includes.  All other
# objects are those of the build without them.
SHARED  := build/$(FLAVOUR)
BUILD   := $(SHARED)
ifneq ($(FORMS),)
BUILD       := $(SHARED)-$(subst /,-,$(FORMS))
FORMS_CORE  := firmware/core/ivl_form.c $(wildcard $(FORMS)/*.c)
FORMS_FLAGS := -I. -DIVL_FORMS_FILE='"$(FORMS)/forms.h"'
endif

# Physics and world are compiled once more for each wider register: rollouts side by side, and the instructions that act on them.  Each such set is
# one object, which shows the functions of sim_width.c and hides the rest.
MACHINE   := $(shell $(COMPILER) -dumpmachine)
WIDTHS    := $(if $(findstring x86_64,$(MACHINE)),4 8)
WIDTH_4   := -mavx2
WIDTH_8   := -mavx512f -mavx512dq -mavx512vl -mprefer-vector-width=512
SHOWN     := ivl_sim_fly ivl_sim_hover
WIDE      := $(WIDTHS:%=$(SHARED)/lanes%.o)
WIDE_PART := $(patsubst %.c,%.o,$(wildcard sim_sil/physics/*.c sim_sil/world/*.c))

CORE    := $(patsubst %.c,$(SHARED)/%.o,$(filter-out $(FORMS_CORE),$(wildcard firmware/core/*.c))) $(FORMS_CORE:%.c=$(BUILD)/%.o)
SENSES  := firmware/app/app_senses.c
VISION  := $(patsubst %.c,$(SHARED)/%.o,$(wildcard firmware/vision/*.c))
SIM     := $(patsubst %.c,$(SHARED)/%.o,$(wildcard sim_sil/*.c sim_sil/physics/*.c sim_sil/world/*.c sim_sil/camera/*.c sim_sil/pil/*.c) $(SENSES)) $(VISION) $(WIDE)
CF      := $(patsubst %.c,$(SHARED)/%.o,$(wildcard sim_sil/cf/*.c) $(filter-out $(SENSES) %/app_cpx.c %/app_rate.c,$(wildcard firmware/app/*.c)))
SUPPORT := $(patsubst %.c,$(SHARED)/%.o,$(filter-out tests/c/test_%,$(wildcard tests/c/*.c)))
TESTS   := $(patsubst tests/c/%.c,%,$(wildcard tests/c/test_*.c))
EXPORTS := sim_sil/exports.map
LIBRARY := host/ivl/_native/libivl_sil.so
SERVER  := host/ivl/_native/ivl_sil
CRTP    := $(patsubst %.c,$(SHARED)/%.o,$(filter-out %/crtp_main.c,$(wildcard sim_sil/crtp/*.c)))
FAKE_CF := $(SHARED)/tests/crtp/fake_cf.o

# what the tests link: the objects, or libraries of them, which are found from the root of the repository; a library stands before what it needs
ifeq ($(FLAVOUR),shared)
TESTED      := $(BUILD)/libtested.so
TESTED_CF   := $(BUILD)/libtested_cf.so
TESTED_CRTP := $(BUILD)/libtested_crtp.so
else
TESTED      := $(CORE) $(SIM)
TESTED_CF   := $(CF)
TESTED_CRTP := $(CRTP)
endif

SEQUENCES ?= 300
SEED      ?= 1
TIMEOUT_S ?= 14400

.DELETE_ON_ERROR:
.SECONDARY:
.PHONY: core lib sil check examples fuzz sequences FORCE

core: $(CORE)

# only the release flavour, without forms from elsewhere, is installed where Python looks for it
INSTALLED := $(and $(filter release,$(FLAVOUR)),$(if $(FORMS),,yes))

lib: $(if $(INSTALLED),$(LIBRARY),$(BUILD)/libivl_sil.so)

sil: $(if $(INSTALLED),$(SERVER),$(BUILD)/ivl_sil)

check: $(TESTS:%=run-%)
	@test -n '$(TESTS)' || { echo 'error: no tests/c/test_*.c found' >&2; exit 1; }
	@echo '$(words $(TESTS)) C test programs passed ($(FLAVOUR))'

# renamed into place, so that a running process keeps the library that it has mapped
$(LIBRARY): $(BUILD)/libivl_sil.so
	@mkdir -p $(@D)
	@cp $< $@.new && mv -f $@.new $@

$(BUILD)/libivl_sil.so: $(CORE) $(SIM) $(BUILD)/objects.txt $(EXPORTS)
	@echo '  LINK  $@'
	@$(COMPILER) $(CFLAGS) $(LTO_LINK_$(FLAVOUR)) -shared -Wl,-Bsymbolic -Wl,--version-script=$(EXPORTS) -o $@ $(filter %.o,$^) $(LDLIBS)

$(SERVER): $(BUILD)/ivl_sil
	@mkdir -p $(@D)
	@cp $< $@.new && mv -f $@.new $@

$(BUILD)/ivl_sil: $(CORE) $(SIM) $(CF) $(CRTP) $(SHARED)/sim_sil/crtp/crtp_main.o $(BUILD)/objects.txt
	@echo '  LINK  $@'
	@$(COMPILER) $(CFLAGS) $(LTO_LINK_$(FLAVOUR)) -o $@ $(filter %.o,$^) $(LDLIBS)

fuzz: $(BUILD)/fuzz_crtp $(BUILD)/fuzz_vision

sequences: $(BUILD)/loop_sequences
	@timeout --verbose $(TIMEOUT_S) $< $(SEQUENCES) $(SEED)
	@if timeout --verbose $(TIMEOUT_S) $< $(SEQUENCES) $(SEED) --traitor > $(BUILD)/loop_traitor.txt; then echo 'error: loop_sequences did not find the traitor' >&2; exit 1; fi
	@grep -q 'a stranger' $(BUILD)/loop_traitor.txt || { cat $(BUILD)/loop_traitor.txt; exit 1; }

# sockets and clock are the program's own
$(BUILD)/loop_sequences: $(SHARED)/tests/fuzz/loop_sequences.o $(CORE) $(SIM) $(CF) $(filter-out %/crtp_udp.o,$(CRTP)) $(SUPPORT) $(SHARED)/unity.o $(BUILD)/objects.txt
	@echo '  LINK  $@'
	@$(COMPILER) $(CFLAGS) $(AS_THEY_ARE) -Wl,--wrap=clock_gettime -Wl,--wrap=ivl_crtp_step -o $@ $(filter %.o,$^) $(LDLIBS)

$(BUILD)/fuzz_crtp: $(SHARED)/tests/fuzz/fuzz_crtp.o $(CORE) $(SIM) $(CF) $(CRTP) $(BUILD)/objects.txt
	@echo '  LINK  $@'
	@$(COMPILER) $(CFLAGS) -fsanitize=fuzzer -o $@ $(filter %.o,$^) $(LDLIBS)

$(BUILD)/fuzz_vision: $(SHARED)/tests/fuzz/fuzz_vision.o $(VISION) $(BUILD)/objects.txt
	@echo '  LINK  $@'
	@$(COMPILER) $(CFLAGS) -fsanitize=fuzzer -o $@ $(filter %.o,$^) $(LDLIBS)

define link_test
@echo '  LINK  $@'
@$(COMPILER) $(CFLAGS) $(AS_THEY_ARE) -o $@ $(filter %.o %.so,$^) $(LDLIBS)
endef

$(BUILD)/test_crtp_%: $(SHARED)/tests/c/test_crtp_%.o $(TESTED_CRTP) $(TESTED) $(FAKE_CF) $(SUPPORT) $(SHARED)/unity.o $(BUILD)/objects.txt
	$(link_test)

$(BUILD)/test_%: $(SHARED)/tests/c/test_%.o $(TESTED) $(SUPPORT) $(SHARED)/unity.o $(BUILD)/objects.txt
	$(link_test)

$(BUILD)/test_cf_%: $(SHARED)/tests/c/test_cf_%.o $(TESTED_CF) $(TESTED) $(SUPPORT) $(SHARED)/unity.o $(BUILD)/objects.txt
	$(link_test)

define link_tested
@echo '  LINK  $@'
@$(COMPILER) $(CFLAGS) -shared -o $@ $(filter %.o,$^) $(LDLIBS)
endef

$(BUILD)/libtested.so: $(CORE) $(SIM)
	$(link_tested)

$(BUILD)/libtested_cf.so: $(CF)
	$(link_tested)

$(BUILD)/libtested_crtp.so: $(CRTP)
	$(link_tested)

# the core as other firmware compiles it: in C, and in C++ with the headers of a system
EXAMPLES := $(BUILD)/examples/bare_loop $(BUILD)/examples/autopilot

examples: $(EXAMPLES)
	@for program in $(EXAMPLES); do echo "  FLY   $$program"; $$program || exit 1; done

$(BUILD)/examples/bare_loop: examples/bare_loop.c examples/planar.h $(CORE)
	@echo '  LINK  $@'
	@mkdir -p $(@D)
	@$(COMPILER) -std=c11 -Wall -Wextra -pedantic -Wshadow -Werror -ffp-contract=off -Ifirmware/core -o $@ $(filter %.c %.o,$^) -lm

$(BUILD)/examples/autopilot: examples/autopilot.cpp examples/planar.h $(CORE)
	@echo '  LINK  $@'
	@mkdir -p $(@D)
	@$(CXX) -std=c++17 -Wall -Wextra -pedantic -Wshadow -Werror -ffp-contract=off -isystem firmware/core -Iexamples -o $@ $(filter %.cpp %.o,$^) -lm

run-test_%: $(BUILD)/test_% FORCE
	@tools/run_unity.sh $<

define compile
@echo '  CC    $@'
@mkdir -p $(@D)
@$(COMPILER) $(CFLAGS) $(LTO_$(FLAVOUR)) $(WARNINGS) $(FLAGS_$(<D)) $(FLAGS_$(basename $(@F))) $(WIDTH) -MMD -MP -c -o $@ $<
endef

$(SHARED)/%.o: %.c $(SHARED)/flags.txt
	$(compile)

ifneq ($(FORMS),)
$(BUILD)/%.o: private CFLAGS += $(FORMS_FLAGS)
$(BUILD)/%.o: %.c $(SHARED)/flags.txt
	$(compile)
endif

define width
$(SHARED)/lanes$1/%.o: WIDTH = -DIVL_SIM_LANES=$1 $(WIDTH_$1) $(THIN_$(FLAVOUR))
$(SHARED)/lanes$1/%.o: %.c $(SHARED)/flags.txt
	$$(compile)

$(SHARED)/lanes$1.o: $(WIDE_PART:%=$(SHARED)/lanes$1/%) $(SHARED)/widths.txt
	@echo '  LD    $$@'
	@$(COMBINE) -o $$@ $$(filter %.o,$$^)
	@objcopy $(SHOWN:%=--keep-global-symbol=%_lanes$1) $$@
endef
$(foreach n,$(WIDTHS),$(eval $(call width,$n)))

$(SHARED)/unity.o: WARNINGS :=
$(SHARED)/unity.o: $(UNITY)/unity.c tools/native.mk
	$(compile)

# rewritten only when their content changes: compile anew when flags do, link anew when a source comes or goes
ALL_FLAGS   := $(COMPILER) $(CFLAGS) $(LTO_$(FLAVOUR)) $(LTO_LINK_$(FLAVOUR)) $(WARNINGS) $(foreach v,$(sort $(filter FLAGS_% WIDTH_%,$(.VARIABLES))),$v=$($v))
ALL_OBJECTS := $(WIDE_PART) $(CORE) $(SIM) $(CF) $(CRTP) $(SUPPORT)

define remember
@mkdir -p $(@D)
@printf '%s\n' '$1' | cmp -s - $@ || printf '%s\n' '$1' > $@
endef

$(SHARED)/flags.txt: FORCE
	$(call remember,$(ALL_FLAGS))

$(BUILD)/objects.txt: FORCE
	$(call remember,$(ALL_OBJECTS))

$(SHARED)/widths.txt: FORCE
	$(call remember,$(WIDE_PART))

-include $(patsubst %.o,%.d,$(CORE) $(SIM) $(CF) $(CRTP) $(FAKE_CF) $(SHARED)/sim_sil/crtp/crtp_main.o $(SHARED)/tests/fuzz/fuzz_crtp.o $(SHARED)/tests/fuzz/fuzz_vision.o $(SHARED)/tests/fuzz/loop_sequences.o $(SUPPORT) $(TESTS:%=$(SHARED)/tests/c/%.o) \
    $(foreach n,$(WIDTHS),$(WIDE_PART:%=$(SHARED)/lanes$n/%)))
