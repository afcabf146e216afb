/// @file crtp_log_value.c
/// A log variable of one type sent as another.
#include <math.h>
#include <string.h>

#include "crtp_log_value.h"
#include "crtp_number.h"

#define FETCH_HALF 8u

size_t ivl_crtp_log_size(uint8_t type)
{
    static const uint8_t SIZE[] = {
        [IVL_CF_LOG_U8] = 1,  [IVL_CF_LOG_U16] = 2, [IVL_CF_LOG_U32] = 4, [IVL_CF_LOG_I8] = 1,
        [IVL_CF_LOG_I16] = 2, [IVL_CF_LOG_I32] = 4, [IVL_CF_LOG_F32] = 4, [FETCH_HALF] = 2,
    };
    return (type < sizeof SIZE) ? SIZE[type] : 0u;
}

static int64_t integer_at(const ivl_cf_log_t *row)
{
    uint8_t  u8;
    uint16_t u16;
    uint32_t u32;
    int8_t   i8;
    int16_t  i16;
    int32_t  i32;
    switch ((ivl_cf_log_type_t)row->type)
    {
    case IVL_CF_LOG_U8:
        memcpy(&u8, row->address, sizeof u8);
        return u8;
    case IVL_CF_LOG_U16:
        memcpy(&u16, row->address, sizeof u16);
        return u16;
    case IVL_CF_LOG_U32:
        memcpy(&u32, row->address, sizeof u32);
        return u32;
    case IVL_CF_LOG_I8:
        memcpy(&i8, row->address, sizeof i8);
        return i8;
    case IVL_CF_LOG_I16:
        memcpy(&i16, row->address, sizeof i16);
        return i16;
    case IVL_CF_LOG_I32:
        memcpy(&i32, row->address, sizeof i32);
        return i32;
    case IVL_CF_LOG_F32:
    default:
        return 0;
    }
}

// towards zero; beyond the range of 32 bits the end of the range, NaN 0, since C leaves both undefined
static int64_t truncated(float value)
{
    if (isnan(value))
    {
        return 0;
    }
    return (value >= 2147483648.0f) ? INT32_MAX : ((value <= -2147483648.0f) ? INT32_MIN : (int64_t)value);
}

// an integer goes out as its lowest bytes, as the drone sends it
size_t ivl_crtp_log_value(const ivl_cf_log_t *row, uint8_t fetch, uint8_t *bytes)
{
    const bool is_float = row->type == IVL_CF_LOG_F32;
    float      real = 0.0f;
    if (is_float)
    {
        memcpy(&real, row->address, sizeof real);
    }
    const int64_t integer = is_float ? truncated(real) : integer_at(row);
    real = is_float ? real : (float)integer;
    uint32_t bits = (uint32_t)((uint64_t)integer & 0xffffffffu);
    if (fetch == IVL_CF_LOG_F32)
    {
        memcpy(&bits, &real, sizeof bits);
    }
    else if (fetch == FETCH_HALF)
    {
        bits = ivl_crtp_half(real);
    }
    const size_t size = ivl_crtp_log_size(fetch);
    for (size_t i = 0; i < size; i++)
    {
        bytes[i] = (uint8_t)(bits >> (8u * i));
    }
    return size;
}
