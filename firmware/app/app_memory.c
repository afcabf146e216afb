/// @file app_memory.c
/// The flight recorder as a memory of the SDK (MEM_TYPE_APP), read-only.  Runs in the task of the memory port.
#include "app_ivl.h"
#include "mem.h"

static uint32_t size(const uint8_t internal_id)
{
    (void)internal_id;
    return ivl_record_size();
}

static bool read(const uint8_t internal_id, const uint32_t memAddr, const uint8_t readLen, uint8_t *buffer)
{
    (void)internal_id;
    return ivl_record_read(&ivl_app.recorder, memAddr, readLen, buffer);
}

void app_memory_register(void)
{
    static const MemoryHandlerDef_t definition = {.type = MEM_TYPE_APP, .getSize = size, .read = read};
    memoryRegisterHandler(&definition);
}
