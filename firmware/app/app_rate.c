/// @file app_rate.c
/// Rates of the drone's stabilizer.
#include "app_ivl.h"
#include "stabilizer_types.h"

bool app_has_rate(float tick_hz)
{
    const float rates_hz[] = {RATE_1000_HZ, RATE_500_HZ, RATE_250_HZ};
    bool        has_rate = false;
    for (size_t i = 0; i < sizeof rates_hz / sizeof rates_hz[0]; i++)
    {
        has_rate = has_rate || ((tick_hz >= rates_hz[i]) && (tick_hz <= rates_hz[i]));
    }
    return has_rate;
}
