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
    bool    known, exact;
    uint8_t group_mask;
    bool    flag[2];
    float   v[5];
} high_level_t;

// COMMAND, bytes behind the group mask, then floats; take-off and land have their flag between the floats
static const struct
{
    uint8_t n_flags, n_values;
    bool    known;
} HIGH_LEVEL[] = {
    [1] = {0, 2, true},   // takeoff: height, duration
    [2] = {0, 2, true},   // land
    [3] = {0, 0, true},   // stop
    [4] = {1, 5, true},   // go_to: relative, x y z yaw duration
    [7] = {1, 3, true},   // takeoff2: height, yaw, use current yaw, duration
    [8] = {1, 3, true},   // land2
    [12] = {2, 5, true},  // go_to2: relative, linear, x y z yaw duration
};

static high_level_t read_high_level(uint8_t command, ivl_crtp_reader_t *r)
{
    high_level_t h = {.known = (command < sizeof HIGH_LEVEL / sizeof HIGH_LEVEL[0]) && HIGH_LEVEL[command].known};
    if (!h.known)
    {
        return h;
    }
    const bool is_vertical = (command == 7u) || (command == 8u);
    h.group_mask = ivl_crtp_u8(r);
    if (is_vertical)
    {
        floats(r, h.v, 2);
        h.flag[0] = ivl_crtp_u8(r) != 0u;
        floats(r, h.v + 2, 1);
    }
    else
    {
        for (int i = 0; i < HIGH_LEVEL[command].n_flags; i++)
        {
            h.flag[i] = ivl_crtp_u8(r) != 0u;
        }
        floats(r, h.v, HIGH_LEVEL[command].n_values);
    }
    h.exact = ivl_crtp_exact(r);
    return h;
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
    case 7:
        return ivl_cf_hl_takeoff(cf, h->v[0], h->v[1], h->flag[0], h->v[2]);
    case 8:
        return ivl_cf_hl_land(cf, h->v[0], h->v[1], h->flag[0], h->v[2]);
    case 12:
        return ivl_cf_hl_go_to(cf, h->flag[0], h->flag[1], h->v, h->v[3], h->v[4]);
    default:
        return IVL_CRTP_ENOEXEC;
    }
}

static int high_level(ivl_crtp_t *crtp, uint8_t command, ivl_crtp_reader_t *r)
{
    if (command == 0u)
    {
        const uint8_t mask = ivl_crtp_u8(r);
        crtp->group_mask = ivl_crtp_exact(r) ? mask : crtp->group_mask;
        return ivl_crtp_exact(r) ? IVL_CRTP_OK : IVL_CRTP_EINVAL;
    }
    const high_level_t h = read_high_level(command, r);
    if (!h.known)
    {
        return IVL_CRTP_ENOEXEC;
    }
    if (!h.exact)
    {
        return IVL_CRTP_EINVAL;
    }
    const bool is_meant = (h.group_mask == 0u) || ((h.group_mask & crtp->group_mask) != 0u);
    return is_meant ? do_high_level(crtp->cf, command, &h) : IVL_CRTP_OK;
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
