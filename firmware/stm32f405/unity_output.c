/// @file unity_output.c
/// Where the unit tests print when they run on the chip: line by line to the host's standard error.
#include "unity_output.h"

#include "semihost.h"

void unity_output_char(int c)
{
    static char   line[160];
    static size_t n;
    line[n++] = (char)c;
    if ((c == '\n') || (n == sizeof line - 1u))
    {
        line[n] = '\0';
        semihost_print(line);
        n = 0;
    }
}
