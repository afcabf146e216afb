/// @file ivl_form.c
#include "ivl_form.h"

#define ROW(name) &ivl_form_##name,
static const ivl_form_t *const FORMS[] = {IVL_FORMS(ROW)};

const ivl_form_t *ivl_form(uint32_t number)
{
    const ivl_form_t *form = (number < sizeof FORMS / sizeof FORMS[0]) ? FORMS[number] : NULL;
    // a form with more parameters than there is room for is none
    return ((form != NULL) && (form->n_params <= IVL_FORM_PARAMS_MAX)) ? form : NULL;
}
