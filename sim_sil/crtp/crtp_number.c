#include "crtp_number.h"

#include <math.h>
#include <string.h>

uint16_t ivl_crtp_half(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    const uint32_t sign = (bits >> 16) & 0x8000u;
    const uint32_t magnitude = bits & 0x7fffffffu;
    if (magnitude > 0x7f800000u)
    {
        return (uint16_t)(sign | 0x7e00u);
    }
    // 65520 and more round to infinity
    if (magnitude >= 0x477ff000u)
    {
        return (uint16_t)(sign | 0x7c00u);
    }
    // below 2^-14 the result is a multiple of 2^-24, and the processor's own rounding makes it
    if (magnitude < 0x38800000u)
    {
        return (uint16_t)(sign | (uint32_t)lrintf(fabsf(value) * 16777216.0f));
    }
    const uint32_t odd = (magnitude >> 13) & 1u;
    return (uint16_t)(sign | ((magnitude - 0x38000000u + 0xfffu + odd) >> 13));
}

bool ivl_crtp_quat(uint32_t bits, float q[4])
{
    static const float UNIT = 0.70710678f / 511.0f;
    const unsigned     largest = bits >> 30;
    float              c[4];
    float              sum = 0.0f;
    for (unsigned k = 4; k-- > 0u;)
    {
        if (k != largest)
        {
            const float magnitude = (float)(bits & 0x1ffu) * UNIT;
            c[k] = ((bits & 0x200u) != 0u) ? -magnitude : magnitude;
            sum += c[k] * c[k];
            bits >>= 10;
        }
    }
    if (!(sum < 1.0f))
    {
        return false;
    }
    c[largest] = sqrtf(1.0f - sum);
    memcpy(q, c, sizeof c);
    return true;
}
