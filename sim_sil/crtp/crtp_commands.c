/// @file crtp_commands.c
/// Ports that move the vehicle: set-points (3, 7), high-level commander (8), localization (6).  A set-point is not answered; one of a wrong
/// length, or with values that the vehicle refuses, is counted.
#include "crtp_commands.h"
#include "crtp_number.h"

static void floats(ivl_crtp_reader_t *r, float *values, int n)
{
    for (int i = 0; i < n; i++)
    {
        values[i] = ivl_crtp_f32(r);
    }
}

static void milli(ivl_crtp_reader_t *r, float *values, int n)
{
    for (int i = 0; i < n; i++)
    {
        values[i] = (float)ivl_crtp_i16(r) / 1000.0f;
    }
}

static void count_if(ivl_crtp_t *crtp, bool refused)
{
    if (refused)
    {
        ivl_crtp_bad(crtp);
    }
}

// ---- set-points

void ivl_crtp_rpyt_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet)
{
    ivl_crtp_reader_t r = ivl_crtp_read(packet);
    float             v[3];
    floats(&r, v, 3);
    const uint16_t thrust = ivl_crtp_u16(&r);
    count_if(crtp, (packet->channel != 0u) || !ivl_crtp_exact(&r) || !ivl_cf_set_rpyt(crtp->cf, v[0], v[1], v[2], thrust));
}

static bool set_full_state(ivl_cf_t *cf, ivl_crtp_reader_t *r)
{
    float p_m[3], v_mps[3], a_mps2[3], w_radps[3], q[4];
    milli(r, p_m, 3);
    milli(r, v_mps, 3);
    milli(r, a_mps2, 3);
    const uint32_t quat = ivl_crtp_u32(r);
    milli(r, w_radps, 3);
    return ivl_crtp_exact(r) && ivl_crtp_quat(quat, q) && ivl_cf_set_full_state(cf, p_m, v_mps, a_mps2, q, w_radps);
}

static bool set_manual(ivl_cf_t *cf, ivl_crtp_reader_t *r)
{
    float v[3];
    floats(r, v, 3);
    const uint16_t thrust = ivl_crtp_u16(r);
    const bool     rate = ivl_crtp_u8(r) != 0u;
    return ivl_crtp_exact(r) && ivl_cf_set_manual(cf, v[0], v[1], v[2], thrust, rate);
}

// channels of a radio control, and up to ten more, of which the first switches levelling
static bool set_cppm(ivl_cf_t *cf, ivl_crtp_reader_t *r)
{
    const uint8_t n_more = ivl_crtp_u8(r) & 0x0Fu;
    uint16_t      pulse_us[4];
    for (int i = 0; i < 4; i++)
    {
        pulse_us[i] = ivl_crtp_u16(r);
    }
    bool level = true;
    for (uint8_t i = 0; i < n_more; i++)
    {
        const uint16_t more_us = ivl_crtp_u16(r);
        level = level && ((i > 0u) || (more_us >= 1500u));
    }
    return ivl_crtp_exact(r) && (n_more <= 10u) && ivl_cf_set_cppm(cf, pulse_us, level);
}

// the older numbers of three kinds have the yaw rate with the other sign
static bool set_four(ivl_cf_t *cf, uint8_t type, ivl_crtp_reader_t *r)
{
    float v[4];
    floats(r, v, 4);
    if (!ivl_crtp_exact(r))
    {
        return false;
    }
    switch (type)
    {
    case 1:
        return ivl_cf_set_velocity(cf, v, -v[3]);
    case 2:
        return ivl_cf_set_zdistance(cf, v[0], v[1], -v[2], v[3]);
    case 4:
        return ivl_cf_set_althold(cf, v[0], v[1], v[2], v[3]);
    case 5:
        return ivl_cf_set_hover(cf, v[0], v[1], -v[2], v[3]);
    case 7:
        return ivl_cf_set_position(cf, v, v[3]);
    case 8:
        return ivl_cf_set_velocity(cf, v, v[3]);
    case 9:
        return ivl_cf_set_zdistance(cf, v[0], v[1], v[2], v[3]);
    case 10:
        return ivl_cf_set_hover(cf, v[0], v[1], v[2], v[3]);
    default:
        return false;
    }
}

static bool set_generic(ivl_cf_t *cf, ivl_crtp_reader_t *r)
{
    const uint8_t type = ivl_crtp_u8(r);
    switch (r->good ? type : 0xFFu)
    {
    case 0:
        return ivl_crtp_exact(r) && ivl_cf_set_stop(cf);
    case 3:
        return set_cppm(cf, r);
    case 6:
        return set_full_state(cf, r);
    case 11:
        return set_manual(cf, r);
    default:
        return set_four(cf, type, r);
    }
}

static bool notify_stop(ivl_cf_t *cf, ivl_crtp_reader_t *r)
{
    const uint8_t  command = ivl_crtp_u8(r);
    const uint32_t remain_ms = ivl_crtp_u32(r);
    if (!ivl_crtp_exact(r) || (command != 0u))
    {
        return false;
    }
    ivl_cf_notify_stop(cf, remain_ms);
    return true;
}

void ivl_crtp_generic_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet)
{
    ivl_crtp_reader_t r = ivl_crtp_read(packet);
    bool              good = false;
    if (packet->channel == 0u)
    {
        good = set_generic(crtp->cf, &r);
    }
    else if (packet->channel == 1u)
    {
        good = notify_stop(crtp->cf, &r);
    }
    count_if(crtp, !good);
}

// ---- high-level commander

typedef struct
{
    uint8_t id;
    bool    flag[3];
    float   v[5];
} high_level_t;

// What follows the command and the groups: f float, b flag, u number of a trajectory.  NULL: not known, or read by itself.
static const char *const HIGH_LEVEL[] = {
    [1] = "ff",        // takeoff: height, duration
    [2] = "ff",        // land
    [3] = "",          // stop
    [4] = "bfffff",    // go_to: relative, x y z yaw duration
    [5] = "bbuf",      // start_trajectory: relative, reversed, number, time scale
    [7] = "ffbf",      // takeoff2: height, yaw, use current yaw, duration
    [8] = "ffbf",      // land2
    [9] = "fbfbf",     // takeoff_with_velocity: height, relative, yaw, use current yaw, speed
    [10] = "fbfbf",    // land_with_velocity
    [11] = "bbfffff",  // spiral: sideways, clockwise, angle, radii, climb, duration
    [12] = "bbfffff",  // go_to2: relative, linear, x y z yaw duration
    [13] = "bbbuf",    // start_trajectory2: relative position, relative yaw, reversed, number, time scale
};

enum
{
    SET_GROUP = 0,
    DEFINE_TRAJECTORY = 6
};

static high_level_t read_high_level(const char *form, ivl_crtp_reader_t *r)
{
    high_level_t h = {.id = 0};
    unsigned     n_flags = 0, n_values = 0;
    for (; *form != '\0'; form++)
    {
        if (*form == 'f')
        {
            h.v[n_values++] = ivl_crtp_f32(r);
        }
        else if (*form == 'b')
        {
            h.flag[n_flags++] = ivl_crtp_u8(r) != 0u;
        }
        else
        {
            h.id = ivl_crtp_u8(r);
        }
    }
    return h;
}

static int start_trajectory(ivl_cf_t *cf, const high_level_t *h, bool has_yaw)
{
    const ivl_cf_start_t how = {.relative_position = h->flag[0],
                                .relative_yaw = has_yaw && h->flag[1],
                                .reversed = has_yaw ? h->flag[2] : h->flag[1],
                                .timescale = h->v[0]};
    return ivl_cf_hl_start(cf, h->id, &how);
}

static int spiral(ivl_cf_t *cf, const high_level_t *h)
{
    const ivl_cf_spiral_t asked = {.sideways = h->flag[0],
                                   .clockwise = h->flag[1],
                                   .phi_rad = h->v[0],
                                   .r0_m = h->v[1],
                                   .r1_m = h->v[2],
                                   .climb_m = h->v[3],
                                   .duration_s = h->v[4]};
    return ivl_cf_hl_spiral(cf, &asked);
}

static int do_high_level(ivl_cf_t *cf, uint8_t command, const high_level_t *h)
{
    switch (command)
    {
    case 1:
        return ivl_cf_hl_takeoff(cf, h->v[0], 0.0f, false, h->v[1]);
    case 2:
        return ivl_cf_hl_land(cf, h->v[0], 0.0f, false, h->v[1]);
    case 3:
        return ivl_cf_hl_stop(cf);
    case 4:
        return ivl_cf_hl_go_to(cf, h->flag[0], false, h->v, h->v[3], h->v[4]);
    case 5:
        return start_trajectory(cf, h, false);
    case 7:
        return ivl_cf_hl_takeoff(cf, h->v[0], h->v[1], h->flag[0], h->v[2]);
    case 8:
        return ivl_cf_hl_land(cf, h->v[0], h->v[1], h->flag[0], h->v[2]);
    case 9:
        return ivl_cf_hl_takeoff_at(cf, h->v[0], h->flag[0], h->v[1], h->flag[1], h->v[2]);
    case 10:
        return ivl_cf_hl_land_at(cf, h->v[0], h->flag[0], h->v[1], h->flag[1], h->v[2]);
    case 11:
        return spiral(cf, h);
    case 12:
        return ivl_cf_hl_go_to(cf, h->flag[0], h->flag[1], h->v, h->v[3], h->v[4]);
    case 13:
        return start_trajectory(cf, h, true);
    default:
        return IVL_CRTP_ENOEXEC;
    }
}

static int define_trajectory(ivl_cf_t *cf, ivl_crtp_reader_t *r)
{
    const uint8_t       id = ivl_crtp_u8(r);
    ivl_cf_definition_t definition;
    definition.location = ivl_crtp_u8(r);
    definition.type = ivl_crtp_u8(r);
    definition.offset = ivl_crtp_u32(r);
    definition.n_pieces = ivl_crtp_u8(r);
    return ivl_crtp_exact(r) ? ivl_cf_hl_define(cf, id, &definition) : IVL_CRTP_EINVAL;
}

static int set_group(ivl_cf_t *cf, ivl_crtp_reader_t *r)
{
    const uint8_t mask = ivl_crtp_u8(r);
    if (!ivl_crtp_exact(r))
    {
        return IVL_CRTP_EINVAL;
    }
    ivl_cf_hl_group(cf, mask);
    return IVL_CRTP_OK;
}

static int high_level(ivl_crtp_t *crtp, uint8_t command, ivl_crtp_reader_t *r)
{
    if (command == SET_GROUP)
    {
        return set_group(crtp->cf, r);
    }
    if (command == DEFINE_TRAJECTORY)
    {
        return define_trajectory(crtp->cf, r);
    }
    if ((command >= sizeof HIGH_LEVEL / sizeof HIGH_LEVEL[0]) || (HIGH_LEVEL[command] == NULL))
    {
        return IVL_CRTP_ENOEXEC;
    }
    const uint8_t      groups = ivl_crtp_u8(r);
    const high_level_t h = read_high_level(HIGH_LEVEL[command], r);
    if (!ivl_crtp_exact(r))
    {
        return IVL_CRTP_EINVAL;
    }
    return ivl_cf_hl_is_meant(crtp->cf, groups) ? do_high_level(crtp->cf, command, &h) : IVL_CRTP_OK;
}

// the answer is the first three bytes of the request, then the error
void ivl_crtp_high_level_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet)
{
    ivl_crtp_reader_t r = ivl_crtp_read(packet);
    const uint8_t     command = ivl_crtp_u8(&r);
    if (!r.good || (packet->channel != 0u))
    {
        ivl_crtp_bad(crtp);
        return;
    }
    const int error = high_level(crtp, command, &r);
    count_if(crtp, (error == IVL_CRTP_EINVAL) || (error == IVL_CRTP_ENOEXEC));
    ivl_crtp_packet_t reply = ivl_crtp_packet(packet->port, 0);
    for (unsigned i = 0; i < 3u; i++)
    {
        ivl_crtp_put_u8(&reply, (i < packet->size) ? packet->data[i] : 0);
    }
    ivl_crtp_put_u8(&reply, (uint8_t)error);
    ivl_crtp_send(crtp, &reply);
}

// ---- localization

static bool ext_position(ivl_cf_t *cf, ivl_crtp_reader_t *r)
{
    float p_m[3];
    floats(r, p_m, 3);
    return ivl_crtp_exact(r) && ivl_cf_ext_position(cf, p_m);
}

static bool ext_pose(ivl_cf_t *cf, ivl_crtp_reader_t *r)
{
    float p_m[3], q[4];
    floats(r, p_m, 3);
    floats(r, q, 4);
    return ivl_crtp_exact(r) && ivl_cf_ext_pose(cf, p_m, q);
}

// Items of several vehicles in one packet; those of others are passed over.  All must be whole before one is used.
static bool packed(const ivl_crtp_t *crtp, ivl_crtp_reader_t *r, bool with_attitude)
{
    const size_t item = with_attitude ? 11u : 7u;
    const size_t n = ivl_crtp_left(r) / item;
    if ((n == 0u) || (n * item != ivl_crtp_left(r)))
    {
        return false;
    }
    bool good = true;
    for (size_t i = 0; i < n; i++)
    {
        float         p_m[3], q[4];
        const uint8_t id = ivl_crtp_u8(r);
        milli(r, p_m, 3);
        const uint32_t quat = with_attitude ? ivl_crtp_u32(r) : 0u;
        if (id == crtp->address)
        {
            good =
                good && (with_attitude ? ivl_crtp_quat(quat, q) && ivl_cf_ext_pose(crtp->cf, p_m, q) : ivl_cf_ext_position(crtp->cf, p_m));
        }
    }
    return good;
}

static bool localization_generic(ivl_crtp_t *crtp, ivl_crtp_reader_t *r)
{
    const uint8_t type = ivl_crtp_u8(r);
    switch (r->good ? type : 0xFFu)
    {
    case 3:
        if (ivl_crtp_exact(r))
        {
            ivl_cf_estop(crtp->cf);
        }
        return ivl_crtp_exact(r);
    case 4:
        if (ivl_crtp_exact(r))
        {
            ivl_cf_estop_watchdog(crtp->cf);
        }
        return ivl_crtp_exact(r);
    case 8:
        return ext_pose(crtp->cf, r);
    case 9:
        return packed(crtp, r, true);
    default:
        return false;
    }
}

void ivl_crtp_localization_handle(ivl_crtp_t *crtp, const ivl_crtp_packet_t *packet)
{
    ivl_crtp_reader_t r = ivl_crtp_read(packet);
    bool              good = false;
    switch (packet->channel)
    {
    case 0:
        good = ext_position(crtp->cf, &r);
        break;
    case 1:
        good = localization_generic(crtp, &r);
        break;
    case 2:
        good = packed(crtp, &r, false);
        break;
    default:
        break;
    }
    count_if(crtp, !good);
}
