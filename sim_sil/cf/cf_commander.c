#include "cf_commander.h"

void ivl_cf_commander_init(ivl_cf_commander_t *c)
{
    *c = (ivl_cf_commander_t){.priority = IVL_CF_PRIORITY_DISABLE, .thrust_locked = true};
}

bool ivl_cf_commander_set(ivl_cf_commander_t *c, const ivl_cf_setpoint_t *setpoint, ivl_cf_priority_t priority, uint32_t now_ms)
{
    if (priority < c->priority)
    {
        return false;
    }
    c->setpoint = *setpoint;
    c->setpoint.t_ms = now_ms;
    c->priority = priority;
    return true;
}

void ivl_cf_commander_relax(ivl_cf_commander_t *c)
{
    c->priority = IVL_CF_PRIORITY_DISABLE;
}

uint32_t ivl_cf_commander_age_ms(const ivl_cf_commander_t *c, uint32_t now_ms)
{
    return now_ms - c->setpoint.t_ms;
}

bool ivl_cf_setpoint_idle(const ivl_cf_setpoint_t *setpoint)
{
    return setpoint->z == IVL_CF_MODE_OFF && !(setpoint->thrust_norm > 0.0f);
}
