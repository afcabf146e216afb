# Compiles firmware core, C tests and the programs of firmware/stm32f405 for the STM32F405.  Called by the Makefile as
#     make -f tools/stm32.mk FLAVOUR=<flavour> <target>
# Targets: core, programs, tests, check, fuzz, install, layout.  Everything made is in build/<flavour>/.

FLAVOUR ?= stm32-Os
CLANG   ?= clang-14
CROSS   ?= arm-none-eabi-

FLAVOURS               := stm32-Os stm32-O2 stm32-clang
OPTIMISE_stm32-Os      := -Os
OPTIMISE_stm32-O2      := -O2
OPTIMISE_stm32-clang   := -O2
ifeq ($(filter $(FLAVOUR),$(FLAVOURS)),)
$(error FLAVOUR=$(FLAVOUR) is not one of: $(FLAVOURS))
endif

# clang takes headers and libraries of the C library from the other compiler, and links through it
LINKER := $(CROSS)gcc
ifeq ($(FLAVOUR),stm32-clang)
# asked for at the first use, when the compilers are there
HEADERS   = $(firstword $(wildcard /usr/lib/arm-none-eabi/include $(dir $(shell $(LINKER) -print-file-name=libc.a))../include))
COMPILER := $(CLANG) --target=thumbv7em-none-eabihf
SYSTEM    = -isystem $(HEADERS)
else
COMPILER := $(LINKER)
endif

WARNINGS := -Wall -Wextra -pedantic -Wconversion -Wsign-conversion -Wdouble-promotion -Wfloat-equal -Wshadow -Wundef \
            -Wswitch-enum -Wcast-align -Wmissing-prototypes -Wstrict-prototypes -Wvla -Werror
MACHINE  := -mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16
# enums as wide as on the host: the structs of the core cross the border as they are
CFLAGS   := -std=c11 $(OPTIMISE_$(FLAVOUR)) $(MACHINE) -DIVL_NO_TEXT -ffp-contract=off -fno-math-errno -fno-short-enums \
            -ffunction-sections -fdata-sections -g -Ifirmware/core -Ifirmware/vision -Ifirmware/stm32f405
LDFLAGS  := $(OPTIMISE_$(FLAVOUR)) $(MACHINE) -nostartfiles -static -T firmware/stm32f405/stm32f405.ld -Wl,--gc-sections \
            -Wl,--fatal-warnings -Wl,--no-enum-size-warning -Wl,--no-wchar-size-warning -Wl,-z,noexecstack

# Unity is a foreign source: a system header to the tests, compiled without our warnings
UNITY         := build/unity
FLAGS_unity   := -DUNITY_INCLUDE_DOUBLE -DUNITY_SUPPORT_64 -DUNITY_OUTPUT_CHAR=unity_output_char \
                 '-DUNITY_OUTPUT_CHAR_HEADER_DECLARATION=unity_output_char(int)' -isystem $(UNITY)
FLAGS_tests/c := $(FLAGS_unity) -Itests/c
FUZZ_FLIGHTS  ?= 400
FLAGS_test_ivl_fuzz := -DN_FLIGHTS=$(FUZZ_FLIGHTS)
FLAGS_test_ivl_math := -DSWEEP_STRIDE=97
FLAGS_test_ivl_vision := -DN_VISION_FUZZ=6
# the start-up code fills and clears memory: its loops must not become calls to themselves
FLAGS_startup := -fno-builtin

BUILD    := build/$(FLAVOUR)
SHARED    := $(BUILD)
# FORMS=folder adds forms of policies (firmware/core/ivl_form.h): its sources, and its forms.h.  Of the other sources only ivl_form.c
# sees them, so all other objects are those of the build without them.
ifneq ($(FORMS),)
BUILD       := $(SHARED)-$(subst /,-,$(FORMS))
FORMS_FLAGS := -I. -DIVL_FORMS_FILE='"$(FORMS)/forms.h"'
FORMS_CORE  := firmware/core/ivl_form.c $(wildcard $(FORMS)/*.c)
endif
TARGET   := firmware/stm32f405
PROGRAMS := tick_server replay faults
CORE     := $(patsubst %.c,$(SHARED)/%.o,$(filter-out $(FORMS_CORE),$(wildcard firmware/core/*.c))) $(FORMS_CORE:%.c=$(BUILD)/%.o)
VISION   := $(patsubst %.c,$(SHARED)/%.o,$(wildcard firmware/vision/*.c))
COMMON   := $(SHARED)/$(TARGET)/startup.o $(SHARED)/$(TARGET)/semihost.o
TESTS    := $(patsubst tests/c/%.c,%,$(wildcard tests/c/test_ivl_*.c))
INSTALLED := host/ivl/_native/stm32f405.elf

.DELETE_ON_ERROR:
.SECONDARY:
.PHONY: core programs tests check fuzz install layout FORCE

core: $(CORE)

programs: $(PROGRAMS:%=$(BUILD)/%.elf)

tests: $(TESTS:%=$(BUILD)/%.elf)

check: $(TESTS:%=run-%)
	@test -n '$(TESTS)' || { echo 'error: no tests/c/test_ivl_*.c found' >&2; exit 1; }
	@echo '$(words $(TESTS)) C test programs passed on the emulated chip ($(FLAVOUR))'

# renamed into place, so that a running emulator keeps the image that it has loaded
install: $(INSTALLED)

$(INSTALLED): $(BUILD)/tick_server.elf
	@mkdir -p $(@D)
	@cp $< $@.new && mv -f $@.new $@

# ten million ticks, half of them on inputs that are spoiled in bursts
fuzz:
	@$(MAKE) --no-print-directory -f tools/stm32.mk FLAVOUR=$(FLAVOUR) BUILD=build/$(FLAVOUR)-fuzz FUZZ_FLIGHTS=20000 TIMEOUT_S=1800 run-test_ivl_fuzz

# how structs lie on this computer: for a comparison of debug informations
layout: build/layout/layout.o

build/layout/layout.o: tests/stm32/layout.c $(wildcard firmware/core/*.h) $(TARGET)/ivl_port.h
	@mkdir -p $(@D)
	@$(or $(CC),cc) -std=c11 -g -Ifirmware/core -I$(TARGET) -c -o $@ $<

define link
@echo '  LINK  $@'
@$(LINKER) $(LDFLAGS) -o $@ $(filter %.o,$^) -lm
endef

$(BUILD)/tick_server.elf $(BUILD)/replay.elf: $(BUILD)/%.elf: $(SHARED)/$(TARGET)/%.o $(SHARED)/$(TARGET)/serve.o $(CORE) $(COMMON) \
                                             $(TARGET)/stm32f405.ld
	$(link)

$(BUILD)/faults.elf: $(SHARED)/$(TARGET)/faults.o $(COMMON) $(TARGET)/stm32f405.ld
	$(link)

# the estimator is for a camera's processor; here its tests show that it has the same bits
$(BUILD)/test_%.elf: $(SHARED)/tests/c/test_%.o $(CORE) $(VISION) $(COMMON) $(SHARED)/tests/c/default_fixture.o $(SHARED)/unity.o \
                     $(SHARED)/$(TARGET)/unity_output.o $(TARGET)/stm32f405.ld
	$(link)

run-test_%: $(BUILD)/test_%.elf FORCE
	@RUNNER=tools/run_stm32.sh tools/run_unity.sh $< < /dev/null

define compile
@echo '  CC    $@'
@mkdir -p $(@D)
@$(COMPILER) $(CFLAGS) $(SYSTEM) $(WARNINGS) $(FLAGS_$(@D:$(SHARED)/%=%)) $(FLAGS_$(basename $(@F))) -MMD -MP -c -o $@ $<
endef

$(SHARED)/%.o: %.c $(SHARED)/flags.txt
	$(compile)

ifneq ($(FORMS),)
$(BUILD)/%.o: private CFLAGS += $(FORMS_FLAGS)
$(BUILD)/%.o: %.c $(SHARED)/flags.txt
	$(compile)
endif

$(SHARED)/unity.o: WARNINGS :=
$(SHARED)/unity.o: $(UNITY)/unity.c $(SHARED)/flags.txt
	$(compile)

# rewritten only when their content changes: compile anew when flags do
ALL_FLAGS = $(COMPILER) $(CFLAGS) $(SYSTEM) $(WARNINGS) $(foreach v,$(sort $(filter FLAGS_%,$(.VARIABLES))),$v=$($v))

$(SHARED)/flags.txt: FORCE
	@mkdir -p $(@D)
	@printf '%s\n' "$(ALL_FLAGS)" | cmp -s - $@ || printf '%s\n' "$(ALL_FLAGS)" > $@

-include $(wildcard $(foreach folder,$(sort $(SHARED) $(BUILD)),$(folder)/*.d $(folder)/*/*.d $(folder)/*/*/*.d))
