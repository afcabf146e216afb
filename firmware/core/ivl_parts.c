/// @file ivl_parts.c
#include "ivl_parts.h"

#include <string.h>

uint32_t ivl_parts_count(uint32_t n)
{
    return (n + IVL_WIRE_THETAS - 1u) / IVL_WIRE_THETAS;
}

bool ivl_parts_is_last(const ivl_wire_policy_t *part)
{
    return (uint32_t)part->part + 1u >= ivl_parts_count(part->n);
}

static bool continues(const ivl_parts_t *parts, const ivl_wire_policy_t *part)
{
    const ivl_policy_id_t *id = &parts->policy.id;
    return parts->begun && (id->seq == part->seq) && (id->crc == part->crc) && (id->form == part->form) && (parts->policy.n == part->n);
}

static void begin(ivl_parts_t *parts, const ivl_wire_policy_t *part)
{
    memset(parts, 0, sizeof *parts);
    parts->policy.id = (ivl_policy_id_t){.seq = part->seq, .crc = part->crc, .form = part->form};
    parts->policy.n = part->n;
    parts->missing = (uint16_t)((1u << ivl_parts_count(part->n)) - 1u);
    parts->begun = true;
}

ivl_wire_status_t ivl_parts_take(ivl_parts_t *parts, const ivl_wire_policy_t *part)
{
    const ivl_form_t *form = ivl_form(part->form);
    if ((form == NULL) || (part->n != form->n_params))
    {
        return IVL_WIRE_ERR_FORM;
    }
    if (part->part >= ivl_parts_count(part->n))
    {
        return IVL_WIRE_ERR_RANGE;
    }
    if (!continues(parts, part))
    {
        begin(parts, part);
    }
    const float values[IVL_WIRE_THETAS] = {part->theta0, part->theta1, part->theta2, part->theta3};
    for (uint32_t i = 0; i < IVL_WIRE_THETAS; i++)
    {
        const uint32_t at = IVL_WIRE_THETAS * part->part + i;
        // what a part carries beyond the last parameter is not taken
        if (at < part->n)
        {
            parts->policy.theta[at] = values[i];
        }
    }
    parts->missing &= (uint16_t)~(1u << part->part);
    if (parts->missing != 0u)
    {
        return IVL_WIRE_ERR_INCOMPLETE;
    }
    if (ivl_policy_crc(&parts->policy) != part->crc)
    {
        parts->begun = false;
        return IVL_WIRE_ERR_CRC;
    }
    return IVL_WIRE_OK;
}
