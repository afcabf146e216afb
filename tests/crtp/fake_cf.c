#include "fake_cf.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

char          fake_said[4096];
fake_cf_t     fake;
fake_values_t fake_values;

// the type is opaque to the server
struct ivl_cf
{
    int unused;
};
static ivl_cf_t vehicle;

__attribute__((format(printf, 1, 2))) static bool say(const char *format, ...)
{
    const size_t n = strlen(fake_said);
    va_list      arguments;
    va_start(arguments, format);
    (void)snprintf(fake_said + n, sizeof fake_said - n, "%s", (n > 0u) ? "; " : "");
    const size_t m = strlen(fake_said);
    (void)vsnprintf(fake_said + m, sizeof fake_said - m, format, arguments);
    va_end(arguments);
    return !fake.refuse;
}

void fake_clear(void)
{
    fake_said[0] = '\0';
}

void fake_reset(void)
{
    memset(&fake, 0, sizeof fake);
    fake_values = (fake_values_t){
        .u8 = 2,
        .i16 = -3,
        .u32 = 70000,
        .f32 = 1.5f,
        .read_only = 9.0f,
        .kept = 0.25f,
        .f64 = 1e-3,
        .u64 = 1ull << 40,
        .l_i8 = -7,
        .l_u16 = 65535,
        .l_i32 = -100000,
        .l_f32 = -2.5f,
    };
    for (size_t i = 0; i < sizeof fake.memory; i++)
    {
        fake.memory[i] = (uint8_t)(i + 1u);
    }
    fake_clear();
}

ivl_cf_t *ivl_cf_open(const ivl_sim_model_t *model, uint64_t seed, char *error, size_t error_size)
{
    (void)model;
    (void)seed;
    (void)error;
    (void)error_size;
    return &vehicle;
}

void ivl_cf_close(ivl_cf_t *cf)
{
    (void)cf;
}

void ivl_cf_step(ivl_cf_t *cf)
{
    (void)cf;
    fake.time_us += 1000u;
    fake_values.t_ms = (uint32_t)(fake.time_us / 1000u);
}

uint64_t ivl_cf_time_us(const ivl_cf_t *cf)
{
    (void)cf;
    return fake.time_us;
}

void ivl_cf_link(ivl_cf_t *cf, bool up)
{
    (void)cf;
    (void)say("link %d", up);
}

void ivl_cf_power_off(ivl_cf_t *cf)
{
    (void)cf;
    (void)say("off");
}

void ivl_cf_power_on(ivl_cf_t *cf)
{
    (void)cf;
    (void)say("on");
}

void ivl_cf_set_address(ivl_cf_t *cf, uint8_t address)
{
    (void)cf;
    (void)say("address %02x", address);
}

void ivl_cf_skip(ivl_cf_t *cf, uint64_t us)
{
    (void)cf, (void)us;
}

bool ivl_cf_is_deck(const char *name)
{
    return strcmp(name, "bcFlow2") == 0;
}

bool ivl_cf_attach(ivl_cf_t *cf, const char *name)
{
    (void)cf;
    return say("attach %s", name);
}

static void was_changed(void)
{
    (void)say("u8 is %d", fake_values.u8);
}

const ivl_cf_param_t *ivl_cf_params(const ivl_cf_t *cf, size_t *n)
{
    static const ivl_cf_param_t ROWS[FAKE_PARAMS] = {
        [FAKE_P_U8] = {.group = "a", .name = "u8", .type = IVL_CF_PARAM_U8, .address = &fake_values.u8, .changed = was_changed},
        [FAKE_P_I16] = {.group = "a", .name = "i16", .type = IVL_CF_PARAM_I16, .address = &fake_values.i16},
        [FAKE_P_U32] = {.group = "a", .name = "u32", .type = IVL_CF_PARAM_U32, .address = &fake_values.u32},
        [FAKE_P_F32] = {.group = "bb", .name = "f32", .type = IVL_CF_PARAM_F32, .core = true, .address = &fake_values.f32},
        [FAKE_P_READ_ONLY] = {.group = "bb", .name = "ro", .type = IVL_CF_PARAM_F32, .read_only = true, .address = &fake_values.read_only},
        [FAKE_P_KEPT] = {.group = "bb", .name = "kept", .type = IVL_CF_PARAM_F32, .persistent = true, .address = &fake_values.kept},
        [FAKE_P_F64] = {.group = "twelve_chars", .name = "of_24_in_all", .type = IVL_CF_PARAM_F64, .address = &fake_values.f64},
        [FAKE_P_U64] = {.group = "c", .name = "u64", .type = IVL_CF_PARAM_U64, .address = &fake_values.u64},
    };
    (void)cf;
    *n = FAKE_PARAMS;
    return ROWS;
}

const ivl_cf_log_t *ivl_cf_logs(const ivl_cf_t *cf, size_t *n)
{
    static const ivl_cf_log_t ROWS[FAKE_LOGS] = {
        [FAKE_L_PHASE] = {.group = "ivl", .name = "phase", .type = IVL_CF_LOG_U8, .address = &fake_values.phase},
        [FAKE_L_ENDED] = {.group = "sil", .name = "ended", .type = IVL_CF_LOG_U8, .address = &fake_values.ended},
        [FAKE_L_I8] = {.group = "l", .name = "i8", .type = IVL_CF_LOG_I8, .address = &fake_values.l_i8},
        [FAKE_L_U16] = {.group = "l", .name = "u16", .type = IVL_CF_LOG_U16, .address = &fake_values.l_u16},
        [FAKE_L_I32] = {.group = "l", .name = "i32", .type = IVL_CF_LOG_I32, .address = &fake_values.l_i32},
        [FAKE_L_F32] = {.group = "l", .name = "f32", .type = IVL_CF_LOG_F32, .address = &fake_values.l_f32},
        [FAKE_L_TIME] = {.group = "l", .name = "t_ms", .type = IVL_CF_LOG_U32, .address = &fake_values.t_ms},
        [FAKE_L_U8] = {.group = "l", .name = "u8", .type = IVL_CF_LOG_U8, .address = &fake_values.u8},
    };
    (void)cf;
    *n = FAKE_LOGS;
    return ROWS;
}

void ivl_cf_logs_refresh(ivl_cf_t *cf)
{
    (void)cf;
    fake.n_refreshed++;
}

// ---- memories: one that can be written, one that cannot

static uint32_t memory_size(void)
{
    return sizeof fake.memory;
}

static bool memory_read(uint32_t address, uint32_t size, uint8_t *bytes)
{
    memcpy(bytes, fake.memory + address, size);
    return !fake.refuse;
}

static bool memory_write(uint32_t address, uint32_t size, const uint8_t *bytes)
{
    memcpy(fake.memory + address, bytes, size);
    return !fake.refuse;
}

const ivl_cf_memory_t *ivl_cf_memories(const ivl_cf_t *cf, size_t *n)
{
    static const ivl_cf_memory_t ROWS[] = {
        {.type = 0x18, .size = memory_size, .read = memory_read, .write = memory_write},
        {.type = 0x01, .size = memory_size, .read = memory_read, .serial = {1, 2, 3, 4, 5, 6, 7, 8}},
    };
    (void)cf;
    *n = sizeof ROWS / sizeof ROWS[0];
    return ROWS;
}

// ---- text and packets

size_t ivl_cf_console_take(ivl_cf_t *cf, char *text, size_t size)
{
    (void)cf;
    if (fake.console == NULL)
    {
        return 0;
    }
    const size_t n = strlen(fake.console) < size ? strlen(fake.console) : size;
    memcpy(text, fake.console, n);
    fake.console = (fake.console[n] == '\0') ? NULL : fake.console + n;
    return n;
}

bool ivl_cf_app_receive(ivl_cf_t *cf, const uint8_t *bytes, size_t size)
{
    (void)cf;
    return say("app %zu bytes from %d", size, (size > 0u) ? bytes[0] : -1);
}

size_t ivl_cf_app_take(ivl_cf_t *cf, uint8_t bytes[IVL_CF_APP_BYTES])
{
    (void)cf;
    const size_t n = fake.app_size;
    memcpy(bytes, fake.app, n);
    fake.app_size = 0;
    return n;
}

// ---- supervisor

bool ivl_cf_flies_high_level(const ivl_cf_t *cf)
{
    (void)cf;
    return fake.flies_high_level;
}

uint16_t ivl_cf_supervisor_info(const ivl_cf_t *cf)
{
    (void)cf;
    return fake.info;
}

bool ivl_cf_arm(ivl_cf_t *cf, bool arm)
{
    (void)cf;
    fake.info = (uint16_t)(arm ? fake.info | 2u : fake.info & ~2u);
    return say("arm %d", arm);
}

bool ivl_cf_recover(ivl_cf_t *cf)
{
    (void)cf;
    return say("recover");
}

void ivl_cf_estop(ivl_cf_t *cf)
{
    (void)cf;
    (void)say("estop");
}

void ivl_cf_estop_watchdog(ivl_cf_t *cf)
{
    (void)cf;
    (void)say("watchdog");
}

bool ivl_cf_is_armed(const ivl_cf_t *cf)
{
    (void)cf;
    return (fake.info & 2u) != 0u;
}

// ---- commander

#define V3   "(%g %g %g)"
#define D(x) ((double)(x))

bool ivl_cf_set_rpyt(ivl_cf_t *cf, float roll_deg, float pitch_deg, float yawrate_degps, uint16_t thrust)
{
    (void)cf;
    return say("rpyt %g %g %g %u", D(roll_deg), D(pitch_deg), D(yawrate_degps), thrust);
}

bool ivl_cf_set_stop(ivl_cf_t *cf)
{
    (void)cf;
    return say("stop");
}

bool ivl_cf_set_velocity(ivl_cf_t *cf, const float v[3], float yawrate_degps)
{
    (void)cf;
    return say("velocity " V3 " %g", D(v[0]), D(v[1]), D(v[2]), D(yawrate_degps));
}

bool ivl_cf_set_zdistance(ivl_cf_t *cf, float roll_deg, float pitch_deg, float yawrate_degps, float z_m)
{
    (void)cf;
    return say("zdistance %g %g %g %g", D(roll_deg), D(pitch_deg), D(yawrate_degps), D(z_m));
}

bool ivl_cf_set_hover(ivl_cf_t *cf, float vx_B_mps, float vy_B_mps, float yawrate_degps, float z_m)
{
    (void)cf;
    return say("hover %g %g %g %g", D(vx_B_mps), D(vy_B_mps), D(yawrate_degps), D(z_m));
}

bool ivl_cf_set_position(ivl_cf_t *cf, const float p[3], float yaw_deg)
{
    (void)cf;
    return say("position " V3 " %g", D(p[0]), D(p[1]), D(p[2]), D(yaw_deg));
}

bool ivl_cf_set_althold(ivl_cf_t *cf, float roll_deg, float pitch_deg, float yawrate_degps, float vz_mps)
{
    (void)cf;
    return say("althold %g %g %g %g", D(roll_deg), D(pitch_deg), D(yawrate_degps), D(vz_mps));
}

bool ivl_cf_set_cppm(ivl_cf_t *cf, const uint16_t pulse_us[4], bool level)
{
    (void)cf;
    return say("cppm %u %u %u %u %d", pulse_us[0], pulse_us[1], pulse_us[2], pulse_us[3], level);
}

bool ivl_cf_set_manual(ivl_cf_t *cf, float roll_deg, float pitch_deg, float yawrate_degps, uint16_t thrust, bool rate)
{
    (void)cf;
    return say("manual %g %g %g %u %d", D(roll_deg), D(pitch_deg), D(yawrate_degps), thrust, rate);
}

bool ivl_cf_set_full_state(ivl_cf_t *cf, const float p[3], const float v[3], const float a[3], const float q[4], const float w[3])
{
    (void)cf;
    return say("full " V3 " " V3 " " V3 " (%.3f %.3f %.3f %.3f) " V3, D(p[0]), D(p[1]), D(p[2]), D(v[0]), D(v[1]), D(v[2]), D(a[0]),
               D(a[1]), D(a[2]), D(q[0]), D(q[1]), D(q[2]), D(q[3]), D(w[0]), D(w[1]), D(w[2]));
}

void ivl_cf_notify_stop(ivl_cf_t *cf, uint32_t remain_ms)
{
    (void)cf;
    (void)say("notify_stop %u", (unsigned)remain_ms);
}

// ---- high level: busy if told to refuse

static int busy(bool granted)
{
    return granted ? 0 : 16;
}

int ivl_cf_hl_takeoff(ivl_cf_t *cf, float height_m, float yaw_rad, bool use_current_yaw, float duration_s)
{
    (void)cf;
    return busy(say("takeoff %g %g %d %g", D(height_m), D(yaw_rad), use_current_yaw, D(duration_s)));
}

int ivl_cf_hl_land(ivl_cf_t *cf, float height_m, float yaw_rad, bool use_current_yaw, float duration_s)
{
    (void)cf;
    return busy(say("land %g %g %d %g", D(height_m), D(yaw_rad), use_current_yaw, D(duration_s)));
}

int ivl_cf_hl_go_to(ivl_cf_t *cf, bool relative, bool linear, const float p[3], float yaw_rad, float duration_s)
{
    (void)cf;
    return busy(say("go_to %d %d " V3 " %g %g", relative, linear, D(p[0]), D(p[1]), D(p[2]), D(yaw_rad), D(duration_s)));
}

void ivl_cf_hl_group(ivl_cf_t *cf, uint8_t mask)
{
    (void)cf;
    fake.group_mask = mask;
}

bool ivl_cf_hl_is_meant(const ivl_cf_t *cf, uint8_t mask)
{
    (void)cf;
    return mask == 0u || (mask & fake.group_mask) != 0u;
}

int ivl_cf_hl_takeoff_at(ivl_cf_t *cf, float height_m, bool relative, float yaw_rad, bool use_current_yaw, float speed_mps)
{
    (void)cf;
    return busy(say("takeoff_at %g %d %g %d %g", D(height_m), relative, D(yaw_rad), use_current_yaw, D(speed_mps)));
}

int ivl_cf_hl_land_at(ivl_cf_t *cf, float height_m, bool relative, float yaw_rad, bool use_current_yaw, float speed_mps)
{
    (void)cf;
    return busy(say("land_at %g %d %g %d %g", D(height_m), relative, D(yaw_rad), use_current_yaw, D(speed_mps)));
}

int ivl_cf_hl_spiral(ivl_cf_t *cf, const ivl_cf_spiral_t *s)
{
    (void)cf;
    return busy(say("spiral %d %d %g %g %g %g %g", s->sideways, s->clockwise, D(s->phi_rad), D(s->r0_m), D(s->r1_m), D(s->climb_m),
                    D(s->duration_s)));
}

int ivl_cf_hl_define(ivl_cf_t *cf, uint8_t id, const ivl_cf_definition_t *d)
{
    (void)cf;
    return busy(say("define %u %u %u %u %u", id, d->location, d->type, (unsigned)d->offset, d->n_pieces));
}

int ivl_cf_hl_start(ivl_cf_t *cf, uint8_t id, const ivl_cf_start_t *how)
{
    (void)cf;
    return busy(say("start %u %d %d %d %g", id, how->relative_position, how->relative_yaw, how->reversed, D(how->timescale)));
}

int ivl_cf_hl_stop(ivl_cf_t *cf)
{
    (void)cf;
    return busy(say("hl_stop"));
}

// ---- localization

bool ivl_cf_ext_position(ivl_cf_t *cf, const float p[3])
{
    (void)cf;
    return say("ext_position " V3, D(p[0]), D(p[1]), D(p[2]));
}

bool ivl_cf_ext_pose(ivl_cf_t *cf, const float p[3], const float q[4])
{
    (void)cf;
    return say("ext_pose " V3 " (%.3f %.3f %.3f %.3f)", D(p[0]), D(p[1]), D(p[2]), D(q[0]), D(q[1]), D(q[2]), D(q[3]));
}
