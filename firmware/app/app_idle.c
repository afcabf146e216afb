/// @file app_idle.c
/// The idle thrust of the SDK's motors.  An armed brushless vehicle keeps its propellers turning at powerDist.idleThrust, whatever the controller
/// asks for.  Where the core wants a motor to stop, off has to be off: in coast, at touch and hanging, and the rear pair in the flip.  There the
/// parameter is 0, and afterwards what it was.  Nothing is stored, so a vehicle that loses its power boots with its own value.
#include "app_convert.h"
#include "app_ivl.h"
#include "param.h"

void app_idle_find(app_t *app)
{
    app->idle.id = paramGetVarId("powerDist", "idleThrust");
    atomic_store(&app->idle.is_known, PARAM_VARID_IS_VALID(app->idle.id));
}

void app_idle_step(app_t *app)
{
    const bool off = app_stops_motors(&app->out);
    if (!atomic_load(&app->idle.is_known) || (off == app->idle.is_off))
    {
        return;
    }
    app->idle.is_off = off;
    const unsigned int present = paramGetUint(app->idle.id);
    const unsigned int wanted = off ? 0u : app->idle.found;
    app->idle.found = off ? present : app->idle.found;
    // what the host has written meanwhile stays
    if ((present != wanted) && (off || (present == 0u)))
    {
        paramSetInt(app->idle.id, (int)wanted);
    }
}
