/// @file semihost.h
/// Files, messages and the end of a program through the debugger's door (Arm semihosting), as far as it is needed here.
#ifndef SEMIHOST_H
#define SEMIHOST_H
#include <stddef.h>
#include <stdint.h>

/// Exit codes of the programs of this folder; a program that ends by itself returns 0, or its number of failed tests.
/// 124 is what timeout(1) returns, 134 what the emulator does when it gives up.
enum
{
    EXIT_NMI = 110,
    EXIT_HARD_FAULT = 111,
    EXIT_MEMORY_FAULT = 112,
    EXIT_BUS_FAULT = 113,
    EXIT_USAGE_FAULT = 114,
    EXIT_INTERRUPT = 115,  ///< one that nobody enabled
    EXIT_TRANSPORT = 116,  ///< a file could not be opened, read or written
    EXIT_PROTOCOL = 117,   ///< a message that makes no sense
    EXIT_ABORT = 118,      ///< abort(), or a call of the C library that has no meaning here
    EXIT_CODE_MAX = 255
};

/// Handles of the host's standard input and output.
int semihost_open_stdin(void);
int semihost_open_stdout(void);

/// Read up to `size` bytes.  @return bytes read; 0 at the end of the file
size_t semihost_read(int handle, void *to, size_t size);

/// Write all bytes, or end the program with EXIT_TRANSPORT.
void semihost_write(int handle, const void *from, size_t size);

/// A message for people: the host's standard error.
void semihost_print(const char *text);

/// The command line that the host gave, "" if none.  Static storage.
const char *semihost_command_line(void);

/// End the program; codes outside 0..255 become 255.
_Noreturn void semihost_exit(int code);
#endif  // SEMIHOST_H
