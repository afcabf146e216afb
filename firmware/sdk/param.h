/// @file param.h
/// Declared for the app: parameters by table, and values by name.  A write copies the bytes, then calls back; no range is checked.
#ifndef SDK_PARAM_H
#define SDK_PARAM_H
#include <stdint.h>

typedef struct
{
    uint16_t id;
    uint16_t index;
} __attribute__((packed)) paramVarId_t;

#define PARAM_VARID_IS_VALID(varId) (varId.id != 0xffffu)

paramVarId_t paramGetVarId(const char *group, const char *name);
unsigned int paramGetUint(paramVarId_t varid);

/// Write a value of the table, and tell clients.
void paramSetInt(paramVarId_t varid, int valuei);
void paramSetFloat(paramVarId_t varid, float valuef);

struct param_s
{
    uint8_t type;
    uint8_t extended_type;
    char   *name;
    void   *address;
    void (*callback)(void);
    void *(*getter)(void);
};

#define PARAM_UINT8  0x08
#define PARAM_UINT32 0x0A
#define PARAM_FLOAT  0x06
#define PARAM_RONLY  0x40
#define PARAM_GROUP  0x80
#define PARAM_START  1
#define PARAM_STOP   0

#define PARAM_ADD_WITH_CALLBACK(TYPE, NAME, ADDRESS, CALLBACK)                                                                             \
    {.type = TYPE, .name = #NAME, .address = (void *)(ADDRESS), .callback = CALLBACK},
#define PARAM_ADD(TYPE, NAME, ADDRESS) {.type = TYPE, .name = #NAME, .address = (void *)(ADDRESS)},
#define PARAM_ADD_GROUP(TYPE, NAME)    {.type = TYPE, .name = #NAME},

#ifdef SDK_ON_HOST
#define PARAM_STORAGE                                                                                                                      \
    extern struct param_s sdk_params_ivl[];                                                                                                \
    struct param_s
#else
#define PARAM_STORAGE static struct param_s __attribute__((section(".param.ivl"), used))
#endif
#define PARAM_GROUP_START(NAME) PARAM_STORAGE sdk_params_##NAME[] = {PARAM_ADD_GROUP(PARAM_GROUP | PARAM_START, NAME)
#define PARAM_GROUP_STOP(NAME)                                                                                                             \
    PARAM_ADD_GROUP(PARAM_GROUP | PARAM_STOP, stop_##NAME)                                                                                 \
    }                                                                                                                                      \
    ;
#endif  // SDK_PARAM_H
