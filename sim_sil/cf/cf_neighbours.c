/// @file cf_neighbours.c
/// Other vehicles in the room: what a distance sensor sees of them, and what it is to run into one.  A vehicle is seen and felt as the sphere
/// through its motors.  Its wind is not felt.
#include <math.h>

#include "cf_room.h"
#include "cf_vehicle.h"

// of the distance sensors' cone of 27 degrees: the tangent of half of it
static const double CONE_SLOPE = 0.24;

// share of the closing speed that is left, the other way, when two of them meet: frames and guards of plastic; an assumption
static const double RESTITUTION = 0.3;

// A vehicle that has been stepped first sees the other one as it was before they met: it must not take that for a second time.
static const uint64_t APART_US = 20000;

// ---- the room

void ivl_cf_enter(ivl_cf_t *cf, ivl_cf_room_t *room, size_t n)
{
    double spot_m[2];
    ivl_cf_room_spot(n, room->n, spot_m);
    cf->room = room;
    cf->room_seat = n;
    cf->set.sim.start_x_m = (float)spot_m[0];
    cf->set.sim.start_y_m = (float)spot_m[1];
    if (n > 0)
    {
        ivl_cf_world_boot(cf);
    }
    ivl_cf_neighbours_tell(cf);
}

void ivl_cf_skip(ivl_cf_t *cf, uint64_t us)
{
    cf->skipped_us += us;
}

uint64_t ivl_cf_room_us(const ivl_cf_t *cf)
{
    return ivl_cf_time_us(cf) + cf->skipped_us;
}

/// A landing that has been put to its start is one with the surface, wherever the others are.
static bool is_away(const ivl_cf_t *cf)
{
    return cf->episode.running && cf->set.sim.start != IVL_CF_START_AS_FLOWN;
}

void ivl_cf_neighbours_tell(ivl_cf_t *cf)
{
    if (cf->room == NULL)
    {
        return;
    }
    const ivl_sim_kin_t kin = ivl_sim_world_kin(&cf->group, IVL_CF_LANE);
    ivl_cf_place_t      place = {.t_us = ivl_cf_room_us(cf), .is_there = !is_away(cf)};
    for (int i = 0; i < 3; i++)
    {
        place.p_W_m[i] = kin.p_WB_m[i];
        place.v_W_mps[i] = kin.v_WB_mps[i];
    }
    ivl_cf_room_tell(cf->room, cf->room_seat, &place);
}

/// The next vehicle from seat *seat on that is not this one, and is in the room at that time; *seat becomes the one after it.
static bool next_place(const ivl_cf_t *cf, uint64_t t_us, size_t *seat, ivl_cf_place_t *place)
{
    while (cf->room != NULL && *seat < cf->room->n)
    {
        const size_t at = (*seat)++;
        if (at != cf->room_seat && ivl_cf_room_look(cf->room, at, t_us, place))
        {
            return true;
        }
    }
    return false;
}

static double radius_m(const ivl_cf_t *cf)
{
    const double x_m = cf->model.raw.rotor_x_m, y_m = cf->model.raw.rotor_y_m;
    return sqrt(x_m * x_m + y_m * y_m);
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// ---- seen

void ivl_cf_neighbours_look(const ivl_cf_t *cf, uint64_t t_us, const double p_W_m[3], const double b_W[3], double *nearest_m)
{
    const double   r_m = radius_m(cf);
    ivl_cf_place_t place;
    for (size_t seat = 0; next_place(cf, t_us, &seat, &place);)
    {
        const double to_m[3] = {place.p_W_m[0] - p_W_m[0], place.p_W_m[1] - p_W_m[1], place.p_W_m[2] - p_W_m[2]};
        const double along_m = dot(to_m, b_W), distance_m = sqrt(dot(to_m, to_m));
        const double aside2_m2 = dot(to_m, to_m) - along_m * along_m, cone_m = r_m + CONE_SLOPE * along_m;
        const double way_m = (distance_m > r_m) ? distance_m - r_m : 0.0;
        if (along_m > 0.0 && aside2_m2 <= cone_m * cone_m && way_m < *nearest_m)
        {
            *nearest_m = way_m;
        }
    }
}

// ---- felt

/// Velocities change along the line between the two, as equal masses have it; each vehicle does its own half.  Others see the velocity before
/// that, so that both halves are made of the same.
static void bounce(ivl_cf_t *cf, const double normal_W[3], double closing_mps)
{
    const double  change_mps = 0.5 * (1.0 + RESTITUTION) * closing_mps;
    ivl_sim_kin_t kin = ivl_sim_world_kin(&cf->group, IVL_CF_LANE);
    for (int i = 0; i < 3; i++)
    {
        kin.v_WB_mps[i] += change_mps * normal_W[i];
        for (int leg = 0; leg < IVL_SIM_LEGS; leg++)
        {
            kin.v_foot_W_mps[leg][i] += change_mps * normal_W[i];
        }
    }
    ivl_sim_world_place(&cf->group, IVL_CF_LANE, &kin);
}

static void meet(ivl_cf_t *cf, size_t seat, const ivl_cf_place_t *other)
{
    const ivl_sim_kin_t kin = ivl_sim_world_kin(&cf->group, IVL_CF_LANE);
    double              away_W[3], faster_mps[3];
    for (int i = 0; i < 3; i++)
    {
        away_W[i] = kin.p_WB_m[i] - other->p_W_m[i];
        faster_mps[i] = kin.v_WB_mps[i] - other->v_W_mps[i];
    }
    const double distance_m = sqrt(dot(away_W, away_W)), touch_m = 2.0 * radius_m(cf);
    if (!(distance_m > 0.0) || distance_m > touch_m)
    {
        return;
    }
    const double normal_W[3] = {away_W[0] / distance_m, away_W[1] / distance_m, away_W[2] / distance_m};
    const double closing_mps = -dot(faster_mps, normal_W);
    if (closing_mps > 0.0 && ivl_cf_room_us(cf) >= cf->apart_us[seat])
    {
        cf->n_bumps++;
        cf->apart_us[seat] = ivl_cf_room_us(cf) + APART_US;
        ivl_cf_print("SIL: ran into vehicle %u\n", (unsigned)seat);
        bounce(cf, normal_W, closing_mps);
    }
}

void ivl_cf_neighbours_bump(ivl_cf_t *cf)
{
    ivl_cf_place_t place;
    if (cf->grounded || is_away(cf))
    {
        return;
    }
    for (size_t seat = 0; next_place(cf, ivl_cf_room_us(cf), &seat, &place);)
    {
        meet(cf, seat - 1u, &place);
    }
}
