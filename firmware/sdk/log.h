/// @file log.h
/// Declared for the app: log variables by table, and values by name.
#ifndef SDK_LOG_H
#define SDK_LOG_H
#include <stdbool.h>
#include <stdint.h>

typedef uint16_t logVarId_t;

logVarId_t logGetVarId(const char *group, const char *name);
float      logGetFloat(logVarId_t varid);

static inline bool logVarIdIsValid(logVarId_t varId)
{
    return varId != 0xffffu;
}

struct log_s
{
    uint8_t type;
    char   *name;
    void   *address;
};

#define LOG_UINT8  1
#define LOG_UINT16 2
#define LOG_UINT32 3
#define LOG_INT8   4
#define LOG_FLOAT  7
#define LOG_GROUP  0x80
#define LOG_START  1
#define LOG_STOP   0

#define LOG_ADD(TYPE, NAME, ADDRESS) {.type = TYPE, .name = #NAME, .address = (void *)(ADDRESS)},

#ifdef SDK_ON_HOST
#define LOG_STORAGE                                                                                                                        \
    extern struct log_s sdk_logs_ivl[];                                                                                                    \
    struct log_s
#else
#define LOG_STORAGE static const struct log_s __attribute__((section(".log.ivl"), used))
#endif
#define LOG_GROUP_START(NAME) LOG_STORAGE sdk_logs_##NAME[] = {LOG_ADD(LOG_GROUP | LOG_START, NAME, 0)
#define LOG_GROUP_STOP(NAME)                                                                                                               \
    LOG_ADD(LOG_GROUP | LOG_STOP, stop_##NAME, 0)                                                                                          \
    }                                                                                                                                      \
    ;
#endif  // SDK_LOG_H
