/// @file vars.c
/// Prints the tables of ivl_vars.h, a row a line, fields separated by tabs: kind, type, name, unit, low, high, default, text.
#include <stdio.h>

#include "ivl.h"
#include "ivl_vars.h"

#define PARAM(ctype, group, name, field, unit, min, max, dflt, doc)                                                                        \
    printf("param\t%s\t%s.%s\t%s\t%g\t%g\t%g\t%s\n", #ctype, group, name, unit, (double)(min), (double)(max), (double)(dflt), doc);
#define LOG(ctype, group, name, owner, field, unit, doc) printf("log\t%s\t%s.%s\t%s\t\t\t\t%s\n", #ctype, group, name, unit, doc);

int main(void)
{
    IVL_PARAMS(PARAM)
    IVL_LOGS(LOG)
    return 0;
}
