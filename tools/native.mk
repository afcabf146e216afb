# Compiles firmware core, simulator and C tests.  Called by the Makefile as
#     make -f tools/native.mk FLAVOUR=<flavour> <target>
# Targets: core, lib, sil, check, fuzz (flavour fuzz only).  Everything made is in build/<flavour>/.
# Each source is compiled once per flavour; the library and the tests link the same objects.

FLAVOUR ?= release
CLANG   ?= clang-14

SANITIZE := -fsanitize=address,undefined,float-cast-overflow -fno-sanitize-recover=all

# sse2 and avx2 are the release held to registers of 128 and 256 bits
FLAVOURS           := release O0 san sse2 avx2 clang clang-O0 fuzz aarch64
OPTIMISE_release   := -O3 -fno-semantic-interposition
OPTIMISE_aarch64   := $(OPTIMISE_release)
OPTIMISE_O0        := -O0
OPTIMISE_san       := -O1 -g -fno-omit-frame-pointer $(SANITIZE)
OPTIMISE_sse2      := -O3 -DIVL_SIM_WIDEST_BITS=128
OPTIMISE_avx2      := -O3 -DIVL_SIM_WIDEST_BITS=256
OPTIMISE_clang     := -O3
OPTIMISE_clang-O0  := -O0
OPTIMISE_fuzz      := -O2 -g -fno-omit-frame-pointer $(SANITIZE)
ifeq ($(filter $(FLAVOUR),$(FLAVOURS)),)
$(error FLAVOUR=$(FLAVOUR) is not one of: $(FLAVOURS))
endif
COMPILER := $(if $(filter clang% fuzz,$(FLAVOUR)),$(CLANG),$(if $(filter aarch64,$(FLAVOUR)),aarch64-linux-gnu-gcc,$(CC)))

WARNINGS := -Wall -Wextra -pedantic -Wconversion -Wsign-conversion -Wdouble-promotion -Wfloat-equal -Wshadow -Wundef \
            -Wswitch-enum -Wcast-align -Wmissing-prototypes -Wstrict-prototypes -Werror

# no contraction and no -march: the same source gives the same bits on every machine and compiler
CFLAGS := -std=c11 $(OPTIMISE_$(FLAVOUR)) -ffp-contract=off -fno-math-errno -fPIC -pthread \
          -Ifirmware/core -Isim_sil -Isim_sil/physics -Isim_sil/world
LDLIBS := -lm -pthread

# objects of the release flavour also carry what GCC needs to optimise the library as a whole; the tests link them as they are
ifneq ($(findstring Free Software Foundation,$(shell $(CC) --version)),)
LTO_release := -flto -ffat-lto-objects
LTO_LINK_release := -flto=auto
endif

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

# FORMS=folder adds forms of policies (firmware/core/ivl_form.h): its sources, and its forms.h
ifneq ($(FORMS),)
CFLAGS += -I. -DIVL_FORMS_FILE='"$(FORMS)/forms.h"'
endif

BUILD   := build/$(FLAVOUR)$(if $(FORMS),-$(subst /,-,$(FORMS)))
CORE    := $(patsubst %.c,$(BUILD)/%.o,$(wildcard firmware/core/*.c $(if $(FORMS),$(FORMS)/*.c)))
SENSES  := firmware/app/app_senses.c
SIM     := $(patsubst %.c,$(BUILD)/%.o,$(wildcard sim_sil/*.c sim_sil/physics/*.c sim_sil/world/*.c sim_sil/pil/*.c) $(SENSES))
CF      := $(patsubst %.c,$(BUILD)/%.o,$(wildcard sim_sil/cf/*.c) $(filter-out $(SENSES) %/app_cpx.c %/app_rate.c,$(wildcard firmware/app/*.c)))
SUPPORT := $(patsubst %.c,$(BUILD)/%.o,$(filter-out tests/c/test_%,$(wildcard tests/c/*.c)))
TESTS   := $(patsubst tests/c/%.c,%,$(wildcard tests/c/test_*.c))
EXPORTS := sim_sil/exports.map
LIBRARY := host/ivl/_native/libivl_sil.so
SERVER  := host/ivl/_native/ivl_sil
CRTP    := $(patsubst %.c,$(BUILD)/%.o,$(filter-out %/crtp_main.c,$(wildcard sim_sil/crtp/*.c)))
FAKE_CF := $(BUILD)/tests/crtp/fake_cf.o

.DELETE_ON_ERROR:
.SECONDARY:
.PHONY: core lib sil check examples fuzz FORCE

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

$(BUILD)/ivl_sil: $(CORE) $(SIM) $(CF) $(CRTP) $(BUILD)/sim_sil/crtp/crtp_main.o $(BUILD)/objects.txt
	@echo '  LINK  $@'
	@$(COMPILER) $(CFLAGS) $(LTO_LINK_$(FLAVOUR)) -o $@ $(filter %.o,$^) $(LDLIBS)

fuzz: $(BUILD)/fuzz_crtp

$(BUILD)/fuzz_crtp: $(BUILD)/tests/fuzz/fuzz_crtp.o $(CORE) $(SIM) $(CF) $(CRTP) $(BUILD)/objects.txt
	@echo '  LINK  $@'
	@$(COMPILER) $(CFLAGS) -fsanitize=fuzzer -o $@ $(filter %.o,$^) $(LDLIBS)

$(BUILD)/test_crtp_%: $(BUILD)/tests/c/test_crtp_%.o $(CORE) $(SIM) $(CRTP) $(FAKE_CF) $(SUPPORT) $(BUILD)/unity.o $(BUILD)/objects.txt
	@echo '  LINK  $@'
	@$(COMPILER) $(CFLAGS) -o $@ $(filter %.o,$^) $(LDLIBS)

$(BUILD)/test_%: $(BUILD)/tests/c/test_%.o $(CORE) $(SIM) $(SUPPORT) $(BUILD)/unity.o $(BUILD)/objects.txt
	@echo '  LINK  $@'
	@$(COMPILER) $(CFLAGS) -o $@ $(filter %.o,$^) $(LDLIBS)

$(BUILD)/test_cf_%: $(BUILD)/tests/c/test_cf_%.o $(CORE) $(SIM) $(CF) $(SUPPORT) $(BUILD)/unity.o $(BUILD)/objects.txt
	@echo '  LINK  $@'
	@$(COMPILER) $(CFLAGS) -o $@ $(filter %.o,$^) $(LDLIBS)

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
@$(COMPILER) $(CFLAGS) $(LTO_$(FLAVOUR)) $(WARNINGS) $(FLAGS_$(@D:$(BUILD)/%=%)) $(FLAGS_$(basename $(@F))) -MMD -MP -c -o $@ $<
endef

$(BUILD)/%.o: %.c $(BUILD)/flags.txt
	$(compile)

$(BUILD)/unity.o: WARNINGS :=
$(BUILD)/unity.o: $(UNITY)/unity.c tools/native.mk
	$(compile)

# rewritten only when their content changes: compile anew when flags do, link anew when a source comes or goes
ALL_FLAGS   := $(COMPILER) $(CFLAGS) $(LTO_$(FLAVOUR)) $(LTO_LINK_$(FLAVOUR)) $(WARNINGS) $(foreach v,$(sort $(filter FLAGS_%,$(.VARIABLES))),$v=$($v))
ALL_OBJECTS := $(CORE) $(SIM) $(CF) $(CRTP) $(SUPPORT)

define remember
@mkdir -p $(@D)
@printf '%s\n' '$1' | cmp -s - $@ || printf '%s\n' '$1' > $@
endef

$(BUILD)/flags.txt: FORCE
	$(call remember,$(ALL_FLAGS))

$(BUILD)/objects.txt: FORCE
	$(call remember,$(ALL_OBJECTS))

-include $(patsubst %.o,%.d,$(CORE) $(SIM) $(CF) $(CRTP) $(FAKE_CF) $(BUILD)/sim_sil/crtp/crtp_main.o $(BUILD)/tests/fuzz/fuzz_crtp.o $(SUPPORT) $(TESTS:%=$(BUILD)/tests/c/%.o))
