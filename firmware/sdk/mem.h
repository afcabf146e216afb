/// @file mem.h
/// Declared for the app: memories that the host can read in pieces.
#ifndef SDK_MEM_H
#define SDK_MEM_H
#include <stdbool.h>
#include <stdint.h>

typedef enum
{
    MEM_TYPE_APP = 0x18
} MemoryType_t;

typedef struct
{
    MemoryType_t type;
    uint32_t (*getSize)(const uint8_t internal_id);
    bool (*getSerialNbr)(const uint8_t internal_id, const uint8_t max_length, uint8_t *len, uint8_t *buffer);
    bool (*read)(const uint8_t internal_id, const uint32_t memAddr, const uint8_t readLen, uint8_t *buffer);
    bool (*write)(const uint8_t internal_id, const uint32_t memAddr, const uint8_t writeLen, const uint8_t *buffer);
    uint8_t internal_id;
} MemoryHandlerDef_t;

/// Before the start of the memory port only.
void memoryRegisterHandler(const MemoryHandlerDef_t *handlerDef);
#endif  // SDK_MEM_H
