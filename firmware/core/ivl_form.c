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

const ivl_form_group_t *ivl_form_group_of(const ivl_form_t *form, uint32_t i)
{
    for (uint32_t g = 0; g < form->n_groups; g++)
    {
        if (i < form->groups[g].n)
        {
            return &form->groups[g];
        }
        i -= form->groups[g].n;
    }
    return NULL;
}
