/// @file startup.c
/// From reset to main(), and what happens when the processor faults: a line that says what and where, and an exit code of its own.
#include <string.h>

#include "semihost.h"

// from the linker script
extern char       stack_top[], data_begin[], data_end[], bss_begin[], bss_end[];
extern const char data_load[];
extern uint64_t   fault_stack[];

int  main(void);
void reset(void);
void fault(void);
void fault_report(const uint32_t *frame, uint32_t exception);

// System Control Block (Armv7-M architecture reference manual, B3.2)
#define REGISTER(address) (*(volatile uint32_t *)(address))
#define SCB_SHCSR         REGISTER(0xe000ed24u)
#define SCB_CFSR          REGISTER(0xe000ed28u)
#define SCB_HFSR          REGISTER(0xe000ed2cu)
#define SCB_MMFAR         REGISTER(0xe000ed34u)
#define SCB_BFAR          REGISTER(0xe000ed38u)
#define SCB_CPACR         REGISTER(0xe000ed88u)

enum
{
    N_SYSTEM = 16,
    N_INTERRUPT = 82,  // of the STM32F405
    FRAME_PC = 6       // word of the exception frame
};

static const uint32_t FAULTS_ENABLED = 7u << 16;     // memory, bus and usage faults, each with its own exception
static const uint32_t FPU_FULL_ACCESS = 0xfu << 20;  // coprocessors 10 and 11
static const uint32_t RAM_BEGIN = 0x20000000u;

typedef void (*handler_t)(void);

typedef struct
{
    const void *stack;
    handler_t   reset;
    handler_t   others[N_SYSTEM - 2 + N_INTERRUPT];
} vectors_t;

#define FAULT8  fault, fault, fault, fault, fault, fault, fault, fault
#define FAULT32 FAULT8, FAULT8, FAULT8, FAULT8

__attribute__((section(".vectors"), used)) static const vectors_t VECTORS = {
    stack_top,
    reset,
    {FAULT32, FAULT32, FAULT32},
};
_Static_assert(sizeof VECTORS == 4u * (N_SYSTEM + N_INTERRUPT) && N_SYSTEM - 2 + N_INTERRUPT == 96, "a handler each");

void reset(void)
{
    SCB_SHCSR |= FAULTS_ENABLED;
    SCB_CPACR |= FPU_FULL_ACCESS;
    __asm__ volatile("dsb\n isb" ::: "memory");
    memcpy(data_begin, data_load, (size_t)(data_end - data_begin));
    memset(bss_begin, 0, (size_t)(bss_end - bss_begin));
    semihost_exit(main());
}

// the stack may be what is broken, and it holds what is to be reported: report on another one
uint64_t fault_stack[64];
_Static_assert(sizeof fault_stack == 512u, "its end stands in the code below");

__attribute__((naked)) void fault(void)
{
    __asm__ volatile("mov r0, sp\n"
                     "mrs r1, ipsr\n"
                     "ldr r2, =fault_stack + 512\n"
                     "mov sp, r2\n"
                     "b fault_report\n");
}

static void print_hex(const char *name, uint32_t value)
{
    char text[12] = " ";
    for (int i = 0; i < 8; i++)
    {
        text[1 + i] = "0123456789abcdef"[(value >> (28 - 4 * i)) & 15u];
    }
    semihost_print(name);
    semihost_print(text);
}

static int code_of(uint32_t exception)
{
    switch (exception)
    {
    case 2:
        return EXIT_NMI;
    case 3:
        return EXIT_HARD_FAULT;
    case 4:
        return EXIT_MEMORY_FAULT;
    case 5:
        return EXIT_BUS_FAULT;
    case 6:
        return EXIT_USAGE_FAULT;
    default:
        return EXIT_INTERRUPT;
    }
}

__attribute__((used)) void fault_report(const uint32_t *frame, uint32_t exception)
{
    static const char *const NAMES[] = {"NMI", "hard fault", "memory fault", "bus fault", "usage fault", "unexpected interrupt"};
    const int                code = code_of(exception);
    semihost_print(NAMES[code - EXIT_NMI]);
    print_hex(": exception", exception);
    print_hex(", CFSR", SCB_CFSR);
    print_hex(", HFSR", SCB_HFSR);
    print_hex(", MMFAR", SCB_MMFAR);
    print_hex(", BFAR", SCB_BFAR);
    // the frame can only be read where there is memory
    const uint32_t at = (uint32_t)(uintptr_t)frame;
    const uint32_t end = (uint32_t)(uintptr_t)stack_top - 8u * (uint32_t)sizeof *frame;
    if ((at >= RAM_BEGIN) && (at <= end))
    {
        print_hex(", PC", frame[FRAME_PC]);
    }
    semihost_print("\n");
    semihost_exit(code);
}

// the C library may ask for these
_Noreturn void abort(void);
_Noreturn void abort(void)
{
    semihost_exit(EXIT_ABORT);
}

_Noreturn void _exit(int code);
_Noreturn void _exit(int code)
{
    semihost_exit(code);
}
