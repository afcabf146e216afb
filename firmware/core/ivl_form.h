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
    bool  go;         ///< false: the landing is too unlikely, so no flip is to start
    float moment_Nm;  ///< magnitude of the nose-up moment of the flip, >= 0
    float p_land;     ///< estimated probability that this approach ends in a landing; 1 if the form makes no estimate
} ivl_action_t;

/// A run of parameters of one kind.  Ranges and theta are in SI units; people see a value in `unit`, which is `per_unit` in SI.
/// The vehicle needs the ranges only: IVL_NO_TEXT leaves the words out.
typedef struct
{
    uint8_t n;       ///< how many
    float   lo, hi;  ///< allowed range of each, SI
#ifndef IVL_NO_TEXT
    float       per_unit;  ///< 1 unit in SI
    const char *names;     ///< n of them with their unit, for files and tables, a space between: "m_0_Nmm m_x_Nmm"
    const char *symbols;   ///< n of them, for people: "M_0 M_x"
    const char *unit;      ///< that people use
    const char *doc;
#endif
} ivl_form_group_t;

#ifdef IVL_NO_TEXT
#define IVL_FORM_TEXT(per_unit_, unit_, names_, symbols_, doc_)
#else
#define IVL_FORM_TEXT(per_unit_, unit_, names_, symbols_, doc_)                                                                            \
    .per_unit = (per_unit_), .unit = (unit_), .names = (names_), .symbols = (symbols_), .doc = (doc_)
#endif

typedef struct
{
    const char *name;
#ifndef IVL_NO_TEXT
    const char *doc;
#endif
    const ivl_form_group_t *groups;  ///< in the order of theta
    uint8_t                 n_groups;
    uint8_t                 n_params;  ///< of all groups, 1..IVL_FORM_PARAMS_MAX
    /// Asked once a tick of an approach, with valid cues and a ceiling that comes closer.  Pure.
    ivl_action_t (*decide)(const float theta[], const ivl_seen_t *seen);
    /// Largest moment that these parameters can ask for, whatever is seen, N m.
    float (*moment_most_Nm)(const float theta[]);
} ivl_form_t;

#ifdef IVL_NO_TEXT
#define IVL_FORM_DOC(doc_)
#else
#define IVL_FORM_DOC(doc_) .doc = (doc_),
#endif

// clang-format off
/// The forms; a form's number is its place here.
#define IVL_FORMS_BUILT_IN(X) \
    X(constant)             \
    X(polynomial2)          \
    X(polynomial3)          \
    X(bilinear)
// clang-format on

#define IVL_FORM_DECLARE(name) extern const ivl_form_t ivl_form_##name;
IVL_FORMS_BUILT_IN(IVL_FORM_DECLARE)

/// A form by its number, NULL if there is none with that number.
const ivl_form_t *ivl_form(uint32_t number);

/// The group of a form's parameter.
/// @return NULL if the form has no parameter i
const ivl_form_group_t *ivl_form_group_of(const ivl_form_t *form, uint32_t i);
#endif  // IVL_FORM_H
