#include "semihost.h"

enum
{
    SYS_OPEN = 0x01,
    SYS_WRITE0 = 0x04,
    SYS_WRITE = 0x05,
    SYS_READ = 0x06,
    SYS_GET_CMDLINE = 0x15,
    SYS_EXIT_EXTENDED = 0x20,
    MODE_READ_BINARY = 1,
    MODE_WRITE_BINARY = 5
};

static const uint32_t APPLICATION_EXIT = 0x20026u;

static int32_t call(uint32_t operation, const void *argument)
{
    register uint32_t    r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return (int32_t)r0;
}

static int open_file(const char *name, size_t length, uint32_t mode)
{
    const struct
    {
        const char *name;
        uint32_t    mode;
        uint32_t    length;
    } argument = {name, mode, (uint32_t)length};
    const int32_t handle = call(SYS_OPEN, &argument);
    if (handle < 0)
    {
        semihost_print("cannot open the host's standard streams\n");
        semihost_exit(EXIT_TRANSPORT);
    }
    return (int)handle;
}

int semihost_open_stdin(void)
{
    static const char name[] = "/dev/stdin";
    return open_file(name, sizeof name - 1u, MODE_READ_BINARY);
}

int semihost_open_stdout(void)
{
    static const char name[] = "/dev/stdout";
    return open_file(name, sizeof name - 1u, MODE_WRITE_BINARY);
}

// read and write return the number of bytes that were not transferred
static size_t transfer(uint32_t operation, int handle, const void *bytes, size_t size)
{
    const struct
    {
        int32_t     handle;
        const void *bytes;
        uint32_t    size;
    } argument = {handle, bytes, (uint32_t)size};
    const uint32_t left = (uint32_t)call(operation, &argument);
    if (left > size)
    {
        semihost_print("a transfer failed\n");
        semihost_exit(EXIT_TRANSPORT);
    }
    return size - left;
}

size_t semihost_read(int handle, void *to, size_t size)
{
    return transfer(SYS_READ, handle, to, size);
}

void semihost_write(int handle, const void *from, size_t size)
{
    const char *at = from;
    while (size > 0u)
    {
        const size_t n = transfer(SYS_WRITE, handle, at, size);
        if (n == 0u)
        {
            semihost_exit(EXIT_TRANSPORT);
        }
        at += n;
        size -= n;
    }
}

void semihost_print(const char *text)
{
    (void)call(SYS_WRITE0, text);
}

const char *semihost_command_line(void)
{
    static char line[128];
    struct
    {
        char    *line;
        uint32_t size;
    } argument = {line, sizeof line - 1u};
    return (call(SYS_GET_CMDLINE, &argument) == 0) ? line : "";
}

_Noreturn void semihost_exit(int code)
{
    const struct
    {
        uint32_t reason;
        uint32_t code;
    } argument = {APPLICATION_EXIT, ((code >= 0) && (code <= EXIT_CODE_MAX)) ? (uint32_t)code : (uint32_t)EXIT_CODE_MAX};
    for (;;)
    {
        (void)call(SYS_EXIT_EXTENDED, &argument);
    }
}
