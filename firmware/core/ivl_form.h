/// @file ivl_form.h
/// Forms of a policy: what the learned numbers mean, and how they decide.  One file a form (ivl_form_<name>.c), one row a form (IVL_FORMS).
#ifndef IVL_FORM_H
#define IVL_FORM_H
#include "ivl_cues.h"

#define IVL_FORM_PARAMS_MAX 64u

/// What a policy decides in one tick.
typedef struct
{
    bool  flip;       ///< flip now
    bool  go;         ///< false: a flip from here would not land, so none starts
    float moment_Nm;  ///< magnitude of the nose-up moment of the flip, >= 0
} ivl_action_t;

/// One parameter of a form.  Ranges and theta are in SI units; people see a value in `unit`, which is `per_unit` in SI.
typedef struct
{
    const char *name;      ///< with its unit, for files and tables, for example "moment_y_Nmm"
    const char *symbol;    ///< for people, for example "M_yd"
    const char *unit;      ///< that people use
    float       per_unit;  ///< 1 unit in SI
    float       lo, hi;    ///< allowed range, SI
    const char *doc;
} ivl_form_param_t;

typedef struct
{
    const char             *name;
    const char             *doc;
    const ivl_form_param_t *params;
    uint8_t                 n_params;  ///< 1..IVL_FORM_PARAMS_MAX
    /// Asked once a tick of an approach, with valid cues and a ceiling that comes closer.  Pure.
    ivl_action_t (*decide)(const float theta[], const ivl_seen_t *seen);
    /// Largest moment that these parameters can ask for, whatever is seen, N m.
    float (*moment_most_Nm)(const float theta[]);
} ivl_form_t;

// clang-format off
/// The forms; a form's number is its place here.
#define IVL_FORMS_BUILT_IN(X) \
    X(constant)
// clang-format on

/// Forms of one's own stand in a folder that `make FORMS=folder` names: sources, and forms.h with IVL_FORMS_OWN(X).
#ifdef IVL_FORMS_FILE
#include IVL_FORMS_FILE
#else
#define IVL_FORMS_OWN(X)
#endif
#define IVL_FORMS(X) IVL_FORMS_BUILT_IN(X) IVL_FORMS_OWN(X)

#define IVL_FORM_DECLARE(name) extern const ivl_form_t ivl_form_##name;
IVL_FORMS(IVL_FORM_DECLARE)

/// A form by its number, NULL if there is none with that number.
const ivl_form_t *ivl_form(uint32_t number);
#endif  // IVL_FORM_H
