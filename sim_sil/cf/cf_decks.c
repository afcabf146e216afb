/// @file cf_decks.c
/// Decks on board, as far as the world has something to measure for them: a flow deck looks down at the floor, a multi-ranger in five
/// directions, at floor, ceiling and walls.  Each deck has the 1-wire memory by which clients know it.
#include <string.h>

#include "cf_vehicle.h"
#include "ivl_wire.h"

static const uint16_t NOTHING_MM = 32767;
static const double   RANGE_M_MAX = 4.0;
// of the angle between a beam and what it hits: flatter ones do not come back
static const double COS_MIN = 0.5;

// The multi-ranger's task reads every 100 ms what it has started 80 ms before; the flow deck's distance sensor has a period of 25 ms.
static const uint64_t RANGER_MS = 100, RANGER_AGE_MS = 80, DOWN_MS = 25, FLOW_MS = 10;

// flow sensor: pixels across, and the angle that they see
static const double FLOW_PIXELS = 35.0, FLOW_RAD = 0.71674;

// ---- distances

/// Along a beam to a plane at a distance behind it.  @return false if it does not get there
static bool meets(double to_m, double slope, double *way_m)
{
    if (!(slope >= COS_MIN) || !(to_m >= 0.0) || !(to_m <= RANGE_M_MAX * slope))
    {
        return false;
    }
    *way_m = to_m / slope;
    return true;
}

static void nearer(double to_m, double slope, double *nearest_m)
{
    double way_m;
    if (meets(to_m, slope, &way_m) && way_m < *nearest_m)
    {
        *nearest_m = way_m;
    }
}

/// From the body's origin along a direction in the world.
static uint16_t look(const ivl_cf_t *cf, uint64_t t_us, const double p_W_m[3], const double b_W[3])
{
    const double ceiling_m = cf->model.raw.world_ceiling_height_m;
    const double walls_m[2] = {(double)cf->set.sim.wall_x_m, (double)cf->set.sim.wall_y_m};
    double       nearest_m = 2.0 * RANGE_M_MAX;
    nearer(ceiling_m - p_W_m[2], b_W[2], &nearest_m);
    nearer(p_W_m[2], -b_W[2], &nearest_m);
    for (int i = 0; i < 2; i++)
    {
        if (walls_m[i] > 0.0)
        {
            nearer(walls_m[i] - p_W_m[i], b_W[i], &nearest_m);
            nearer(walls_m[i] + p_W_m[i], -b_W[i], &nearest_m);
        }
    }
    ivl_cf_neighbours_look(cf, t_us, p_W_m, b_W, &nearest_m);
    if (nearest_m <= RANGE_M_MAX)
    {
        return (uint16_t)(nearest_m * 1000.0 + 0.5);
    }
    return NOTHING_MM;
}

static uint16_t measure(const ivl_cf_t *cf, uint64_t t_us, const ivl_sim_kin_t *kin, ivl_cf_direction_t direction)
{
    static const double AXES[IVL_CF_DIRECTIONS][3] = {
        [IVL_CF_FRONT] = {1.0, 0.0, 0.0},  [IVL_CF_BACK] = {-1.0, 0.0, 0.0}, [IVL_CF_LEFT] = {0.0, 1.0, 0.0},
        [IVL_CF_RIGHT] = {0.0, -1.0, 0.0}, [IVL_CF_UP] = {0.0, 0.0, 1.0},    [IVL_CF_DOWN] = {0.0, 0.0, -1.0},
    };
    const ivl_rot_t R = ivl_rot_from_quat(kin->q_WB);
    const double   *b = AXES[direction];
    double          b_W[3];
    for (int i = 0; i < 3; i++)
    {
        b_W[i] = R.row[i].x * b[0] + R.row[i].y * b[1] + R.row[i].z * b[2];
    }
    return look(cf, t_us, kin->p_WB_m, b_W);
}

/// Upwards also without the deck: there the world may have a ranging sensor of its own, which the app is given instead.  What was seen is
/// worked out when it is told, so that other vehicles of the room have been stepped to that time, whichever is stepped first.
static void range(ivl_cf_t *cf)
{
    const bool has_deck = cf->set.has_ranger_deck != 0u;
    if (cf->t_ms % RANGER_MS == RANGER_MS - RANGER_AGE_MS)
    {
        cf->range_begun = true;
        cf->range_from_us = ivl_cf_room_us(cf);
        cf->range_from = ivl_sim_world_kin(&cf->group, IVL_CF_LANE);
    }
    if (cf->t_ms % RANGER_MS != 0 || !cf->range_begun)
    {
        return;
    }
    for (int d = IVL_CF_FRONT; d <= IVL_CF_UP; d++)
    {
        if (d == IVL_CF_UP ? !cf->has_range : has_deck)
        {
            cf->range_mm[d] = measure(cf, cf->range_from_us, &cf->range_from, (ivl_cf_direction_t)d);
        }
    }
}

// ---- flow

static int16_t pixels(double n)
{
    return (int16_t)((n > -32767.0) ? ((n < 32767.0) ? n : 32767.0) : -32767.0);
}

/// Pixels that the floor has moved by since the last time: as the firmware's filter expects them of the true motion, in the sensor's own axes.
static void flow(ivl_cf_t *cf)
{
    const ivl_sim_kin_t kin = ivl_sim_world_kin(&cf->group, IVL_CF_LANE);
    const ivl_rot_t     R = ivl_rot_from_quat(kin.q_WB);
    const double       *v = kin.v_WB_mps, dt_s = (double)FLOW_MS * 1.0e-3;
    const double        z_m = (kin.p_WB_m[2] > 0.1) ? kin.p_WB_m[2] : 0.1;
    const double        vx_B = R.row[0].x * v[0] + R.row[1].x * v[1] + R.row[2].x * v[2];
    const double        vy_B = R.row[0].y * v[0] + R.row[1].y * v[1] + R.row[2].y * v[2];
    const double        scale = dt_s * FLOW_PIXELS / FLOW_RAD, up = R.row[2].z;
    const double        along_x = scale * (vx_B * up / z_m - kin.w_B_radps[1]);
    const double        along_y = scale * (vy_B * up / z_m + kin.w_B_radps[0]);
    cf->flow_pixels[0] = pixels(-along_y);
    cf->flow_pixels[1] = pixels(-along_x);
}

void ivl_cf_decks_step(ivl_cf_t *cf)
{
    range(cf);
    if (cf->set.has_flow_deck == 0u)
    {
        return;
    }
    if (cf->t_ms % DOWN_MS == 0)
    {
        const ivl_sim_kin_t kin = ivl_sim_world_kin(&cf->group, IVL_CF_LANE);
        cf->range_mm[IVL_CF_DOWN] = measure(cf, ivl_cf_room_us(cf), &kin, IVL_CF_DOWN);
    }
    if (cf->t_ms % FLOW_MS == 0)
    {
        flow(cf);
    }
}

void ivl_cf_decks_boot(ivl_cf_t *cf)
{
    for (int d = 0; d < IVL_CF_DIRECTIONS; d++)
    {
        cf->range_mm[d] = NOTHING_MM;
    }
    cf->range_begun = false;
}

// ---- which ones, and how clients know them

typedef struct
{
    const char *name;
    uint8_t     product;
} deck_t;

static const deck_t DECKS[IVL_CF_DECKS] = {{"bcFlow2", 0x0F}, {"bcMultiranger", 0x0C}};

static uint8_t *flag_of(ivl_cf_t *cf, size_t deck)
{
    return (deck == 0) ? &cf->set.has_flow_deck : &cf->set.has_ranger_deck;
}

/// A head with maker and product, then the name and the revision as text, each part with the last byte of its CRC-32.
static void write_memory(size_t deck, uint8_t bytes[IVL_CF_ONE_WIRE_BYTES])
{
    enum
    {
        HEAD = 8,
        NAME = 1,
        REVISION = 2
    };
    const uint8_t head[HEAD - 1] = {0xEB, 0, 0, 0, 0, 0xBC, DECKS[deck].product};
    const uint8_t n = (uint8_t)strlen(DECKS[deck].name);
    uint8_t      *at = bytes + HEAD;
    memset(bytes, 0, IVL_CF_ONE_WIRE_BYTES);
    memcpy(bytes, head, sizeof head);
    bytes[HEAD - 1] = (uint8_t)ivl_wire_crc(0, head, sizeof head);
    *at++ = 0;  // version
    *at++ = (uint8_t)(n + 5u);
    *at++ = NAME;
    *at++ = n;
    memcpy(at, DECKS[deck].name, n);
    at += n;
    *at++ = REVISION;
    *at++ = 1;
    *at++ = 'A';
    *at = (uint8_t)ivl_wire_crc(0, bytes + HEAD, (size_t)(at - bytes) - HEAD);
}

/// Its number, or IVL_CF_DECKS.
static size_t number_of(const char *name)
{
    size_t i = 0;
    while (i < IVL_CF_DECKS && strcmp(DECKS[i].name, name) != 0)
    {
        i++;
    }
    return i;
}

bool ivl_cf_is_deck(const char *name)
{
    return number_of(name) < IVL_CF_DECKS;
}

bool ivl_cf_attach(ivl_cf_t *cf, const char *name)
{
    const size_t deck = number_of(name);
    if (deck < IVL_CF_DECKS)
    {
        *flag_of(cf, deck) = 1;
        write_memory(deck, cf->one_wire[deck]);
    }
    return deck < IVL_CF_DECKS;
}

bool ivl_cf_has_deck(const ivl_cf_t *cf, size_t deck)
{
    return ((deck == 0) ? cf->set.has_flow_deck : cf->set.has_ranger_deck) != 0u;
}
