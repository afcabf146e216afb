/// @file default_fixture.c
/// Empty setUp() and tearDown() for test programs that need none; a program's own ones take precedence.
#include "unity.h"

__attribute__((weak)) void setUp(void)
{
}

__attribute__((weak)) void tearDown(void)
{
}
