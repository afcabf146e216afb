# The Crazyflie app without its SDK.  Called by the Makefile as
#     make -f tools/app.mk <target>
# Targets: check (host: unit tests on a stand-in for the SDK), sequences (host: random sequences of events, SEQUENCES of them), objects (Cortex-M4F: core and app with the SDK's own flags, and their sizes).
# firmware/sdk declares what the app uses of the SDK; docs/FIRMWARE.md says when it was last linked against the real one.

CROSS ?= arm-none-eabi-
UNITY := build/unity

SOURCES := $(wildcard firmware/core/*.c firmware/app/*.c)

# FORMS=folder adds forms of policies (firmware/core/ivl_form.h): its sources, and its forms.h.  Of the other sources only ivl_form.c and
# test_app.c see them, so the other objects for the host are those of the build without them.
OWN     := $(if $(FORMS),-$(subst /,-,$(FORMS)))
ifneq ($(FORMS),)
FORMS_SOURCES := $(wildcard $(FORMS)/*.c)
FORMS_FLAGS   := -I. -DIVL_FORMS_FILE='"$(FORMS)/forms.h"'
endif
HEADERS := $(wildcard firmware/core/*.h firmware/app/*.h tests/app/*.h tests/fuzz/*.h firmware/sdk/*.h $(if $(FORMS),$(FORMS)/*.h))

# ---- host: sanitizers on, strict warnings on our own files

HOST_SHARED := build/app
HOST       := $(HOST_SHARED)$(OWN)
HOST_FLAGS := -std=gnu11 -O1 -g -ffp-contract=off -fno-math-errno -fsanitize=address,undefined -fno-sanitize-recover=all \
              -Wall -Wextra -Wdouble-promotion -Wshadow -Wconversion -Wswitch-enum -Wmissing-prototypes -Wstrict-prototypes -Werror \
              -DSDK_ON_HOST -DCONFIG_ENABLE_CPX=1 -Ifirmware/core -Ifirmware/app -Itests/app -Itests/c -isystem firmware/sdk -isystem $(UNITY) -DUNITY_INCLUDE_DOUBLE
HOST_OBJ   := $(patsubst %.c,$(HOST)/%.o,firmware/core/ivl_form.c $(FORMS_SOURCES)) \
              $(patsubst %.c,$(HOST_SHARED)/%.o,$(filter-out %/ivl_form.c,$(SOURCES)) tests/app/sdk_double.c tests/c/default_fixture.c) $(HOST_SHARED)/unity.o
SEQUENCES  ?= 3000
SEED       ?= 1
# a hundred thousand take an hour on a busy machine
TIMEOUT_S  ?= 14400

# ---- Cortex-M4F: the SDK's flags, and the one of our Kbuild files

ARM       := build/firmware$(OWN)
ARM_FLAGS := -DIVL_NO_TEXT -Os -Werror -Wall -Wmissing-braces -fno-strict-aliasing -std=gnu11 -fno-math-errno -Wdouble-promotion -ffunction-sections \
             -fdata-sections -mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16 -g3 -ffp-contract=off -fstack-usage -DCONFIG_ENABLE_CPX=1 \
             -Ifirmware/core -Ifirmware/app -isystem firmware/sdk $(FORMS_FLAGS)
ARM_OBJ   := $(patsubst firmware/%.c,$(ARM)/%.o,$(SOURCES)) $(patsubst $(FORMS)/%.c,$(ARM)/forms/%.o,$(FORMS_SOURCES))
# what the objects may ask of the world: the SDK's functions that firmware/sdk declares, and these of the C library
LIBRARY   := memcpy|memset|memcmp|memmove|strlen

.DELETE_ON_ERROR:
.PHONY: check sequences objects

check: $(HOST)/test_app
	@tools/run_unity.sh $<

# a fuzzer that finds nothing must be able to find something: with --traitor it must
sequences: $(HOST)/sequences
	@timeout --verbose $(TIMEOUT_S) $< $(SEQUENCES) $(SEED)
	@if timeout --verbose $(TIMEOUT_S) $< $(SEQUENCES) $(SEED) --traitor > $(HOST)/traitor.txt; then echo 'error: sequences did not find the traitor' >&2; exit 1; fi
	@grep -q 'a policy changed in flight' $(HOST)/traitor.txt || { cat $(HOST)/traitor.txt; exit 1; }

$(HOST)/test_app: $(HOST)/tests/app/test_app.o $(HOST_OBJ)
	@echo '  LINK  $@'
	@$(CC) $(HOST_FLAGS) -o $@ $^ -lm

$(HOST)/sequences: $(HOST)/tests/fuzz/sequences.o $(HOST_OBJ)
	@echo '  LINK  $@'
	@$(CC) $(HOST_FLAGS) -o $@ $^ -lm

$(HOST_SHARED)/unity.o: $(UNITY)/unity.c
	@mkdir -p $(@D)
	@$(CC) -DUNITY_INCLUDE_DOUBLE -I$(UNITY) -fsanitize=address,undefined -c -o $@ $<

define compile_host
@echo '  CC    $@'
@mkdir -p $(@D)
@$(CC) $(HOST_FLAGS) -c -o $@ $<
endef

$(HOST_SHARED)/%.o: %.c $(HEADERS) tools/app.mk
	$(compile_host)

ifneq ($(FORMS),)
$(HOST)/%.o: private HOST_FLAGS += $(FORMS_FLAGS)
$(HOST)/%.o: %.c $(HEADERS) tools/app.mk
	$(compile_host)
endif

objects: $(ARM_OBJ)
	@tools/check_app.sh $(CROSS) '$(LIBRARY)' $(ARM)

define compile_arm
@echo '  CC    $@'
@mkdir -p $(@D)
@$(CROSS)gcc $(ARM_FLAGS) -c -o $@ $<
endef

$(ARM)/%.o: firmware/%.c $(HEADERS) tools/app.mk
	$(compile_arm)

ifneq ($(FORMS),)
$(ARM)/forms/%.o: $(FORMS)/%.c $(HEADERS) tools/app.mk
	$(compile_arm)
endif
