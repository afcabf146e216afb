/// @file ivl_form.c
#include "ivl_form.h"

/// Forms of one's own stand in a folder that `make FORMS=folder` names: sources, and forms.h with IVL_FORMS_OWN(X).  Nothing else sees that
/// file, so builds with and without it share all other objects.
#ifdef IVL_FORMS_FILE
#include IVL_FORMS_FILE
#else
#define IVL_FORMS_OWN(X)
#endif
IVL_FORMS_OWN(IVL_FORM_DECLARE)

#define IVL_FORMS(X) IVL_FORMS_BUILT_IN(X) IVL_FORMS_OWN(X)

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
