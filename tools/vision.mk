# Compiles the estimator of firmware/vision alone, for each processor that it may run on.  Called by the Makefile as
#     make -f tools/vision.mk
# Everything made is in build/vision/: host.so, and programs for tools/vision/machines.py.

CFLAGS   := -std=c11 -O3 -ffreestanding -fno-builtin -Wall -Wextra -pedantic -Wconversion -Wsign-conversion -Wshadow -Wvla -Werror -Ifirmware/vision
SOURCES  := $(wildcard firmware/vision/*.c) tools/vision/entry.c
HEADERS  := $(wildcard firmware/vision/*.h)
BUILD    := build/vision
MACHINES := rv32imac cortex-m4 aarch64

rv32imac  := riscv64-unknown-elf-gcc -march=rv32imac -mabi=ilp32 -msmall-data-limit=0 -mno-relax -Wl,--no-relax
cortex-m4 := arm-none-eabi-gcc -mcpu=cortex-m4 -mthumb
aarch64   := aarch64-linux-gnu-gcc -fno-stack-protector -static -fno-pie -no-pie

.DELETE_ON_ERROR:
.PHONY: all
all: $(BUILD)/host.so $(MACHINES:%=$(BUILD)/%.elf)

$(BUILD)/host.so: $(SOURCES) $(HEADERS) tools/vision.mk
	@echo '  CC    $@'
	@mkdir -p $(@D)
	@$(or $(CC),cc) $(CFLAGS) -fPIC -shared -o $@ $(SOURCES)

$(BUILD)/%.elf: $(SOURCES) $(HEADERS) tools/vision/memory.c tools/vision.mk
	@echo '  CC    $@'
	@mkdir -p $(@D)
	@$($*) $(CFLAGS) -isystem tools/vision/include -fno-tree-loop-distribute-patterns -nostartfiles -nodefaultlibs -Wl,-Ttext=0x10000 -Wl,-Tdata=0x20000000 -Wl,-e,entry_step -o $@ $(SOURCES) tools/vision/memory.c -lgcc
