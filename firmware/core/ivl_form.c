/// @file ivl_form.c
#include "ivl_form.h"

#define ROW(name) &ivl_form_##name,
static const ivl_form_t *const FORMS[] = {IVL_FORMS(ROW)};

const ivl_form_t *ivl_form(uint32_t number)
{
    return (number < sizeof FORMS / sizeof FORMS[0]) ? FORMS[number] : NULL;
}
