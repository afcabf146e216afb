# Compiles firmware core, simulator and C tests.  Called by the Makefile as
#     make -f tools/native.mk FLAVOUR=<flavour> <target>
# Targets: core, lib, sil, check, fuzz (flavour fuzz only).  Everything made is in build/<flavour>/.
# Each source is compiled once per flavour; the library and the tests link the same objects.

FLAVOUR ?= release
CLANG   ?= clang-14

SANITIZE := -fsanitize=address,undefined,float-cast-overflow -fno-sanitize-recover=all

# sse2 and avx2 are the release held to registers of 128 and 256 bits: its objects, but for the one that knows of widths
FLAVOURS           := release O0 san sse2 avx2 clang clang-O0 fuzz
OPTIMISE_release   := -O3 -fno-semantic-interposition
OPTIMISE_O0        := -O0
OPTIMISE_san       := -O1 -g -fno-omit-frame-pointer $(SANITIZE)
OPTIMISE_clang     := -O3
OPTIMISE_clang-O0  := -O0
OPTIMISE_fuzz      := -O2 -g -fno-omit-frame-pointer $(SANITIZE)
ifeq ($(filter $(FLAVOUR),$(FLAVOURS)),)
$(error FLAVOUR=$(FLAVOUR) is not one of: $(FLAVOURS))
endif
COMPILER := $(if $(filter clang% fuzz,$(FLAVOUR)),$(CLANG),$(CC))

# A build may take the objects of another, BASE, and compile few sources of its own, with further flags.
BASE        := $(FLAVOUR)
ifneq ($(filter sse2 avx2,$(FLAVOUR)),)
BASE        := release
OWN_SOURCES := sim_sil/physics/phys_step.c
OWN_FLAGS   := -DIVL_SIM_WIDEST_BITS=$(if $(filter sse2,$(FLAVOUR)),128,256)
endif
# FORMS=folder adds forms of policies: its sources, and its forms.h, which only ivl_form.c includes
ifneq ($(FORMS),)
OWN_SOURCES += firmware/core/ivl_form.c $(wildcard $(FORMS)/*.c)
OWN_FLAGS   += -I. -DIVL_FORMS_FILE='"$(FORMS)/forms.h"'
endif
SHARED  := build/$(BASE)
BUILD   := build/$(FLAVOUR)$(if $(FORMS),-$(subst /,-,$(FORMS)))
objects  = $(patsubst %.c,$(SHARED)/%.o,$(filter-out $(OWN_SOURCES),$1)) $(patsubst %.c,$(BUILD)/%.o,$(filter $(OWN_SOURCES),$1))

WARNINGS := -Wall -Wextra -pedantic -Wconversion -Wsign-conversion -Wdouble-promotion -Wfloat-equal -Wshadow -Wundef \
            -Wswitch-enum -Wcast-align -Wmissing-prototypes -Wstrict-prototypes -Werror

# no contraction and no -march: the same source gives the same bits on every machine and compiler
CFLAGS := -std=c11 $(OPTIMISE_$(BASE)) -ffp-contract=off -fno-math-errno -fPIC -pthread \
          -Ifirmware/core -Isim_sil -Isim_sil/physics -Isim_sil/world
LDLIBS := -lm -pthread

# objects of the release flavour also carry what GCC needs to optimise library and vehicle as a whole; all others link them as they are, which
# GCC does only if it is told to
ifneq ($(findstring Free Software Foundation,$(shell $(CC) --version)),)
LTO_release := -flto -ffat-lto-objects
LTO_LINK_release := -flto=auto
endif
AS_THEY_ARE := -fno-lto
LTO_LINK    := $(or $(LTO_LINK_$(FLAVOUR)),$(AS_THEY_ARE))
# nothing is inlined into this source or out of it, and it takes as long to compile as all others together
FLAGS_phys_step := -fno-lto

# further flags of a folder, and of a single object by its name without folder and suffix
# the simulator passes vectors by value, within one compilation only: the note that their ABI once changed is idle; it has the app's senses
FLAGS_sim_sil := -Wno-psabi -Ifirmware/app -isystem firmware/sdk
FLAGS_sim_sil/physics := $(FLAGS_sim_sil)
FLAGS_sim_sil/world := $(FLAGS_sim_sil)
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
FLAGS_tests/fuzz   := $(FLAGS_vehicle)

# The fuzzer is guided by the server and the vehicle, not by the physics, which costs time and says little.  Comparisons are followed in the
# server alone: the vehicle searches its tables by name when it starts.
ifeq ($(FLAVOUR),fuzz)
FLAGS_sim_sil/crtp += -fsanitize=fuzzer-no-link
FLAGS_sim_sil/cf   += -fsanitize-coverage=inline-8bit-counters,pc-table
FLAGS_firmware/app += -fsanitize-coverage=inline-8bit-counters,pc-table
endif

CORE    := $(call objects,$(wildcard firmware/core/*.c $(if $(FORMS),$(FORMS)/*.c)))
SENSES  := firmware/app/app_senses.c
SIM     := $(call objects,$(wildcard sim_sil/*.c sim_sil/physics/*.c sim_sil/world/*.c sim_sil/pil/*.c) $(SENSES))
CF      := $(call objects,$(wildcard sim_sil/cf/*.c) $(filter-out $(SENSES) %/app_cpx.c %/app_rate.c,$(wildcard firmware/app/*.c)))
SUPPORT := $(call objects,$(filter-out tests/c/test_%,$(wildcard tests/c/*.c)))
TESTS   := $(patsubst tests/c/%.c,%,$(wildcard tests/c/test_*.c))
EXPORTS := sim_sil/exports.map
LIBRARY := host/ivl/_native/libivl_sil.so
SERVER  := host/ivl/_native/ivl_sil
CRTP    := $(call objects,$(filter-out %/crtp_main.c,$(wildcard sim_sil/crtp/*.c)))
FAKE_CF := $(SHARED)/tests/crtp/fake_cf.o

.DELETE_ON_ERROR:
.SECONDARY:
.PHONY: core lib sil check fuzz FORCE

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
	@$(COMPILER) $(CFLAGS) $(LTO_LINK) -shared -Wl,-Bsymbolic -Wl,--version-script=$(EXPORTS) -o $@ $(filter %.o,$^) $(LDLIBS)

$(SERVER): $(BUILD)/ivl_sil
	@mkdir -p $(@D)
	@cp $< $@.new && mv -f $@.new $@

$(BUILD)/ivl_sil: $(CORE) $(SIM) $(CF) $(CRTP) $(SHARED)/sim_sil/crtp/crtp_main.o $(BUILD)/objects.txt
	@echo '  LINK  $@'
	@$(COMPILER) $(CFLAGS) $(LTO_LINK) -o $@ $(filter %.o,$^) $(LDLIBS)

fuzz: $(BUILD)/fuzz_crtp

$(BUILD)/fuzz_crtp: $(SHARED)/tests/fuzz/fuzz_crtp.o $(CORE) $(SIM) $(CF) $(CRTP) $(BUILD)/objects.txt
	@echo '  LINK  $@'
	@$(COMPILER) $(CFLAGS) -fsanitize=fuzzer -o $@ $(filter %.o,$^) $(LDLIBS)

$(BUILD)/test_crtp_%: $(SHARED)/tests/c/test_crtp_%.o $(CORE) $(SIM) $(CRTP) $(FAKE_CF) $(SUPPORT) $(SHARED)/unity.o $(BUILD)/objects.txt
	@echo '  LINK  $@'
	@$(COMPILER) $(CFLAGS) $(AS_THEY_ARE) -o $@ $(filter %.o,$^) $(LDLIBS)

$(BUILD)/test_%: $(SHARED)/tests/c/test_%.o $(CORE) $(SIM) $(SUPPORT) $(SHARED)/unity.o $(BUILD)/objects.txt
	@echo '  LINK  $@'
	@$(COMPILER) $(CFLAGS) $(AS_THEY_ARE) -o $@ $(filter %.o,$^) $(LDLIBS)

$(BUILD)/test_cf_%: $(SHARED)/tests/c/test_cf_%.o $(CORE) $(SIM) $(CF) $(SUPPORT) $(SHARED)/unity.o $(BUILD)/objects.txt
	@echo '  LINK  $@'
	@$(COMPILER) $(CFLAGS) $(AS_THEY_ARE) -o $@ $(filter %.o,$^) $(LDLIBS)

run-test_%: $(BUILD)/test_% FORCE
	@tools/run_unity.sh $<

define compile
@echo '  CC    $@'
@mkdir -p $(@D)
@$(COMPILER) $(CFLAGS) $(LTO_$(BASE)) $(WARNINGS) $(FLAGS_$(patsubst $(BUILD)/%,%,$(@D:$(SHARED)/%=%))) $(FLAGS_$(basename $(@F))) -MMD -MP -c -o $@ $<
endef

$(SHARED)/%.o: %.c $(SHARED)/flags.txt
	$(compile)

ifneq ($(BUILD),$(SHARED))
$(BUILD)/%.o: private CFLAGS += $(OWN_FLAGS)
$(BUILD)/%.o: %.c $(SHARED)/flags.txt
	$(compile)
endif

$(SHARED)/unity.o: WARNINGS :=
$(SHARED)/unity.o: $(UNITY)/unity.c tools/native.mk
	$(compile)

# rewritten only when their content changes: compile anew when flags do, link anew when a source comes or goes
ALL_FLAGS   := $(COMPILER) $(CFLAGS) $(LTO_$(BASE)) $(LTO_LINK_$(BASE)) $(WARNINGS) $(foreach v,$(sort $(filter FLAGS_%,$(.VARIABLES))),$v=$($v))
ALL_OBJECTS := $(CORE) $(SIM) $(CF) $(CRTP) $(SUPPORT)

define remember
@mkdir -p $(@D)
@printf '%s\n' '$1' | cmp -s - $@ || printf '%s\n' '$1' > $@
endef

$(SHARED)/flags.txt: FORCE
	$(call remember,$(ALL_FLAGS))

$(BUILD)/objects.txt: FORCE
	$(call remember,$(ALL_OBJECTS))

-include $(patsubst %.o,%.d,$(CORE) $(SIM) $(CF) $(CRTP) $(FAKE_CF) $(SHARED)/sim_sil/crtp/crtp_main.o $(SHARED)/tests/fuzz/fuzz_crtp.o $(SUPPORT) $(TESTS:%=$(SHARED)/tests/c/%.o))
