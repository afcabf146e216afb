/// @file faults.c
/// Commits the fault that the command line names; the exit code tells whether it was caught.  Ends with 0 when no fault is named.
#include <string.h>

#include "semihost.h"

#define REGISTER(address) (*(volatile uint32_t *)(address))
#define SCB_CPACR         REGISTER(0xe000ed88u)
#define SCB_SHCSR         REGISTER(0xe000ed24u)
#define NVIC_ISER0        REGISTER(0xe000e100u)
#define NVIC_ISPR0        REGISTER(0xe000e200u)
#define SCB_ICSR          REGISTER(0xe000ed04u)

static void no_fpu(void)
{
    SCB_CPACR = 0;
    __asm__ volatile("dsb\n isb\n vadd.f32 s0, s0, s0" ::: "s0", "memory");
}

static void undefined_instruction(void)
{
    __asm__ volatile("udf #0");
}

static void unaligned_float(void)
{
    static char bytes[8];
    __asm__ volatile("vldr s0, [%0]" ::"r"(bytes + 1) : "s0");
}

static void no_memory(void)
{
    REGISTER(0x60000000u) = 1u;
}

static void not_code(void)
{
    ((void (*)(void))(uintptr_t)0xf0000001u)();
}

static void escalated(void)
{
    SCB_SHCSR = 0;  // without its own exception a fault becomes a hard fault
    undefined_instruction();
}

static void interrupt(void)
{
    NVIC_ISER0 = 1u;
    NVIC_ISPR0 = 1u;
    __asm__ volatile("dsb\n isb" ::: "memory");
}

static void nmi(void)
{
    SCB_ICSR = 1u << 31;
    __asm__ volatile("dsb\n isb" ::: "memory");
}

static void runaway_stack(void)
{
    __asm__ volatile("mov sp, %0\n push {r0-r7}" ::"r"(0x20000008u) : "memory");
}

static void hang(void)
{
    for (;;)
    {
        __asm__ volatile("nop");
    }
}

static const struct
{
    const char *name;
    void (*commit)(void);
} FAULTS[] = {
    {"no_fpu", no_fpu},
    {"undefined_instruction", undefined_instruction},
    {"unaligned_float", unaligned_float},
    {"no_memory", no_memory},
    {"not_code", not_code},
    {"escalated", escalated},
    {"interrupt", interrupt},
    {"nmi", nmi},
    {"runaway_stack", runaway_stack},
    {"hang", hang},
};

int main(void)
{
    const char *line = semihost_command_line();
    for (size_t i = 0; i < sizeof FAULTS / sizeof FAULTS[0]; i++)
    {
        if (strstr(line, FAULTS[i].name) != NULL)
        {
            FAULTS[i].commit();
            semihost_print("the fault went unnoticed\n");
            return EXIT_CODE_MAX;
        }
    }
    return 0;
}
