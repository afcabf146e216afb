#include "world_hover.h"

/// A flight in a lane.
typedef struct
{
    const ivl_sim_hover_t *flight;
    size_t                 n_row, n_reached;  ///< rows written, set-points whose time has come
} seat_t;

/// Tells the core where to be.
static void request(seat_t *seat, ivl_sim_group_t *group, int lane)
{
    ivl_sim_world_t       *world = &group->world[lane];
    const ivl_sim_hover_t *flight = seat->flight;
    while (seat->n_reached < flight->n_setpoint && flight->setpoint[seat->n_reached].t_s <= ivl_sim_world_time_s(group, lane) + 1.0e-9)
    {
        const double *p = flight->setpoint[seat->n_reached].p_W_m;
        world->in.cmd.request = IVL_REQUEST_HOVER;
        world->in.cmd.p_hover_W_m = (ivl_vec3_t){(float)p[0], (float)p[1], (float)p[2]};
        seat->n_reached++;
    }
}

/// The row that is due, if one is.
static void record(const ivl_sim_group_t *group, int lane, double period_s, seat_t *seat)
{
    if (ivl_sim_world_time_s(group, lane) >= (double)seat->n_row * period_s - 1.0e-9)
    {
        ivl_sim_rollout_row(group, lane, &seat->flight->rows[seat->n_row]);
        seat->n_row++;
    }
}

static void take_seat(ivl_sim_group_t *group, int lane, const ivl_sim_hover_t *flight, double period_s, seat_t *seat)
{
    const double still[3] = {0.0, 0.0, 0.0};
    *seat = (seat_t){flight, 0, 0};
    ivl_sim_world_start(group, lane, &flight->rng, flight->setpoint[0].p_W_m, still);
    record(group, lane, period_s, seat);
    request(seat, group, lane);
    ivl_sim_world_tick(group, lane);
}

/// What happens between two ticks.
/// @return false at the end of the flight
static bool goes_on(ivl_sim_group_t *group, int lane, double period_s, size_t n_rows, seat_t *seat)
{
    if (ivl_sim_world_diverged(&group->state, lane))
    {
        for (; seat->n_row < n_rows; seat->n_row++)
        {
            seat->flight->rows[seat->n_row].t_s[0] = (double)NAN;
        }
        return false;
    }
    record(group, lane, period_s, seat);
    if (seat->n_row == n_rows)
    {
        return false;
    }
    request(seat, group, lane);
    ivl_sim_world_tick(group, lane);
    return true;
}

void IVL_SIM_OF_WIDTH(ivl_sim_hover)(const ivl_sim_model_t *model, const ivl_sim_hover_t *flights, size_t n, double period_s, size_t n_rows)
{
    ivl_sim_group_t group;
    seat_t          seat[IVL_SIM_LANES];
    size_t          next = 0, n_over = 0;
    ivl_sim_group_init(model, &group);
    group.port = model->core.open(model->core.context);
    for (int lane = 0; lane < IVL_SIM_LANES && next < n; lane++)
    {
        take_seat(&group, lane, &flights[next++], period_s, &seat[lane]);
    }
    while (n_over < n)
    {
        ivl_sim_group_step(&group);
        for (int lane = 0; lane < IVL_SIM_LANES; lane++)
        {
            if (group.active[lane] && ivl_sim_world_ready(&group, lane) && !goes_on(&group, lane, period_s, n_rows, &seat[lane]))
            {
                n_over++;
                group.active[lane] = false;
                if (next < n)
                {
                    take_seat(&group, lane, &flights[next++], period_s, &seat[lane]);
                }
            }
        }
    }
    model->core.close(group.port);
}
