/// @file cf_memories.c
/// What clients read and write by the memory port, beside the app's recorder: outcome and world of the simulation, and the memories that every
/// Crazyflie has: EEPROM, trajectories, tester, decks, and a 1-wire memory a deck.
#include <string.h>

#include "cf_vehicle.h"

#define THE ivl_cf_the

enum
{
    TYPE_EEPROM = 0x00,
    TYPE_ONE_WIRE = 0x01,
    TYPE_TRAJECTORY = 0x12,
    TYPE_TESTER = 0x15,
    TYPE_DECKS = 0x19,
    TESTER_BYTES = 0x1000,
    DECKS_BYTES = 0x1100,
    DECKS_INFO_BYTES = 1 + 8 * 0x20,  // a version, then eight descriptions
    DECKS_VERSION = 3
};

static bool copy(const void *from, uint32_t total, uint32_t address, uint32_t size, uint8_t *bytes)
{
    if (address > total || size > total - address)
    {
        return false;
    }
    memcpy(bytes, (const uint8_t *)from + address, size);
    return true;
}

static bool put(void *to, uint32_t total, uint32_t address, uint32_t size, const uint8_t *bytes)
{
    if (address > total || size > total - address)
    {
        return false;
    }
    memcpy((uint8_t *)to + address, bytes, size);
    return true;
}

// ---- of the simulation

static uint32_t outcome_size(void)
{
    return (uint32_t)(sizeof(ivl_cf_outcome_header_t) + sizeof(ivl_sim_outcome_t));
}

static bool outcome_read(uint32_t address, uint32_t size, uint8_t *bytes)
{
    const ivl_cf_episode_t *e = &THE.episode;
    ivl_cf_outcome_header_t header = e->header;
    header.magic = IVL_CF_OUTCOME_MAGIC;
    header.size = (uint32_t)sizeof e->outcome;
    uint8_t all[sizeof header + sizeof e->outcome];
    memcpy(all, &header, sizeof header);
    memcpy(all + sizeof header, &e->outcome, sizeof e->outcome);
    return copy(all, (uint32_t)sizeof all, address, size, bytes);
}

static uint32_t world_size(void)
{
    return (uint32_t)sizeof THE.model.raw;
}

static bool world_read(uint32_t address, uint32_t size, uint8_t *bytes)
{
    return copy(&THE.model.raw, world_size(), address, size, bytes);
}

// ---- EEPROM: the radio's settings and a check sum in front, the rest empty

void ivl_cf_eeprom_init(ivl_cf_t *cf, uint8_t address)
{
    // token, version, channel, speed, two trims, radio address from its first byte on
    const uint8_t block[20] = {'0', 'x', 'B', 'C', 1, 80, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0xE7, address, 0xE7, 0xE7, 0xE7};
    uint8_t       sum = 0;
    for (size_t i = 0; i < sizeof block; i++)
    {
        sum = (uint8_t)(sum + block[i]);
    }
    memset(cf->eeprom, 0, sizeof cf->eeprom);
    memcpy(cf->eeprom, block, sizeof block);
    cf->eeprom[sizeof block] = sum;
}

static uint32_t eeprom_size(void)
{
    return (uint32_t)sizeof THE.eeprom;
}

static bool eeprom_read(uint32_t address, uint32_t size, uint8_t *bytes)
{
    return copy(THE.eeprom, eeprom_size(), address, size, bytes);
}

static bool eeprom_write(uint32_t address, uint32_t size, const uint8_t *bytes)
{
    return put(THE.eeprom, eeprom_size(), address, size, bytes);
}

// ---- trajectories

static uint32_t trajectory_size(void)
{
    return IVL_CF_TRAJECTORY_BYTES;
}

static bool trajectory_read(uint32_t address, uint32_t size, uint8_t *bytes)
{
    return copy(THE.planner.uploaded.bytes, trajectory_size(), address, size, bytes);
}

static bool trajectory_write(uint32_t address, uint32_t size, const uint8_t *bytes)
{
    return put(THE.planner.uploaded.bytes, trajectory_size(), address, size, bytes);
}

// ---- tester: each byte is the low one of its address, and is expected to be when it is written

static uint32_t tester_size(void)
{
    return TESTER_BYTES;
}

static bool tester_read(uint32_t address, uint32_t size, uint8_t *bytes)
{
    for (uint32_t i = 0; i < size; i++)
    {
        bytes[i] = (uint8_t)(address + i);
    }
    return true;
}

static bool tester_write(uint32_t address, uint32_t size, const uint8_t *bytes)
{
    if (THE.set.tester_reset != 0u)
    {
        THE.set.tester_reset = 0;
        THE.tester_errors = 0;
    }
    for (uint32_t i = 0; i < size; i++)
    {
        if (bytes[i] != (uint8_t)(address + i))
        {
            THE.tester_errors++;
            break;  // one a packet, as on the drone
        }
    }
    return true;
}

// ---- decks: none of those that can be attached has a memory of its own

static uint32_t decks_size(void)
{
    return DECKS_BYTES;
}

static bool decks_read(uint32_t address, uint32_t size, uint8_t *bytes)
{
    const uint8_t info[DECKS_INFO_BYTES] = {DECKS_VERSION};
    return copy(info, sizeof info, address, size, bytes);
}

static uint32_t one_wire_size(void)
{
    return IVL_CF_ONE_WIRE_BYTES;
}

static bool one_wire_read_0(uint32_t address, uint32_t size, uint8_t *bytes)
{
    return copy(THE.one_wire[0], IVL_CF_ONE_WIRE_BYTES, address, size, bytes);
}

static bool one_wire_write_0(uint32_t address, uint32_t size, const uint8_t *bytes)
{
    return put(THE.one_wire[0], IVL_CF_ONE_WIRE_BYTES, address, size, bytes);
}

static bool one_wire_read_1(uint32_t address, uint32_t size, uint8_t *bytes)
{
    return copy(THE.one_wire[1], IVL_CF_ONE_WIRE_BYTES, address, size, bytes);
}

static bool one_wire_write_1(uint32_t address, uint32_t size, const uint8_t *bytes)
{
    return put(THE.one_wire[1], IVL_CF_ONE_WIRE_BYTES, address, size, bytes);
}

// ---- all of them

const ivl_cf_memory_t *ivl_cf_memories(const ivl_cf_t *cf, size_t *n)
{
    enum
    {
        COMMON = 7
    };
    static const ivl_cf_memory_t ONE_WIRE[IVL_CF_DECKS] = {
        {.type = TYPE_ONE_WIRE,
         .size = one_wire_size,
         .read = one_wire_read_0,
         .write = one_wire_write_0,
         .serial = {0x0D, 0, 0, 0, 0, 0, 0, 1}},
        {.type = TYPE_ONE_WIRE,
         .size = one_wire_size,
         .read = one_wire_read_1,
         .write = one_wire_write_1,
         .serial = {0x0D, 0, 0, 0, 0, 0, 0, 2}},
    };
    static ivl_cf_memory_t memories[COMMON + IVL_CF_DECKS] = {
        [1] = {.type = IVL_CF_MEMORY_OUTCOME, .size = outcome_size, .read = outcome_read},
        [2] = {.type = IVL_CF_MEMORY_WORLD, .size = world_size, .read = world_read},
        [3] = {.type = TYPE_EEPROM, .size = eeprom_size, .read = eeprom_read, .write = eeprom_write},
        [4] = {.type = TYPE_TRAJECTORY, .size = trajectory_size, .read = trajectory_read, .write = trajectory_write},
        [5] = {.type = TYPE_TESTER, .size = tester_size, .read = tester_read, .write = tester_write},
        [6] = {.type = TYPE_DECKS, .size = decks_size, .read = decks_read},
    };
    memories[0] = *ivl_cf_app_memory();
    *n = COMMON;
    for (size_t deck = 0; deck < IVL_CF_DECKS; deck++)
    {
        if (ivl_cf_has_deck(cf, deck))
        {
            memories[(*n)++] = ONE_WIRE[deck];
        }
    }
    return memories;
}
