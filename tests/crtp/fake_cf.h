/// @file fake_cf.h
/// A vehicle that flies nothing and writes down what it was told, linked in place of sim_sil/cf into the tests of the CRTP server.
#ifndef FAKE_CF_H
#define FAKE_CF_H
#include "cf/cf.h"

/// What the vehicle was told since the last fake_clear, calls separated by "; ".
extern char fake_said[4096];

typedef struct
{
    uint64_t    time_us;
    bool        refuse;       ///< every call that can refuse does so
    uint16_t    info;         ///< supervisor bits
    uint32_t    n_refreshed;  ///< calls of ivl_cf_logs_refresh
    const char *console;      ///< text to be told
    uint8_t     app[IVL_CF_APP_BYTES];
    size_t      app_size;  ///< packet to be sent
    bool        flies_high_level;
    uint8_t     group_mask;
    uint8_t     memory[40];
} fake_cf_t;

/// Values behind the tables.
typedef struct
{
    uint8_t  u8;
    int16_t  i16;
    uint32_t u32;
    float    f32, read_only, kept;
    double   f64;
    uint64_t u64;
    uint8_t  phase, ended;
    int8_t   l_i8;
    uint16_t l_u16;
    int32_t  l_i32;
    float    l_f32;
    uint32_t t_ms;
} fake_values_t;

extern fake_cf_t     fake;
extern fake_values_t fake_values;

/// Numbers of rows in the tables.
enum
{
    FAKE_P_U8,
    FAKE_P_I16,
    FAKE_P_U32,
    FAKE_P_F32,
    FAKE_P_READ_ONLY,
    FAKE_P_KEPT,
    FAKE_P_F64,
    FAKE_P_U64,
    FAKE_PARAMS
};
enum
{
    FAKE_L_PHASE,
    FAKE_L_ENDED,
    FAKE_L_I8,
    FAKE_L_U16,
    FAKE_L_I32,
    FAKE_L_F32,
    FAKE_L_TIME,
    FAKE_L_U8,
    FAKE_LOGS
};

void fake_reset(void);
void fake_clear(void);
#endif  // FAKE_CF_H
