/// @file crtp_faults.h
/// What a bad link does to packets: loss, delay, jitter, reordering, duplication, a cut.  Sits between the socket and the server, in both
/// directions.  Every decision is a function of (seed, direction, number of the packet): the same traffic meets the same faults again.
/// Without faults a packet passes straight through.
#ifndef IVL_CRTP_FAULTS_H
#define IVL_CRTP_FAULTS_H
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "crtp_packet.h"

/// X(type, name, unit, lo, hi, doc): each is a parameter fault.<name> and a command-line option.
// clang-format off
#define IVL_CRTP_FAULTS(X)                                                                                     \
    X(float, loss, "1", 0, 1, "probability that a packet is lost")                                             \
    X(float, delay_ms, "ms", 0, 10000, "delay of every packet, one way")                                       \
    X(float, jitter_ms, "ms", 0, 10000, "further delay, uniform from 0 to this; the order stays")              \
    X(float, reorder, "1", 0, 1, "probability that a packet is held back, so that later ones overtake it")     \
    X(float, duplicate, "1", 0, 1, "probability that a packet arrives twice")                                  \
    X(uint32_t, seed, "1", 0, 4294967295, "of all draws")
// clang-format on

typedef struct
{
#define IVL_CRTP_FAULT_MEMBER(type, name, unit, lo, hi, doc) type name;
    IVL_CRTP_FAULTS(IVL_CRTP_FAULT_MEMBER)
#undef IVL_CRTP_FAULT_MEMBER
} ivl_crtp_fault_cfg_t;

typedef enum
{
    IVL_CRTP_TO_VEHICLE,
    IVL_CRTP_TO_HOST,
    IVL_CRTP_DIRECTIONS
} ivl_crtp_direction_t;

/// A datagram on its way.
typedef struct
{
    uint64_t             due_us, order;
    ivl_crtp_direction_t direction;
    uint64_t             peer;  ///< opaque to this layer
    uint8_t              size;
    uint8_t              bytes[IVL_CRTP_BYTES_MAX];
} ivl_crtp_datagram_t;

typedef struct
{
    ivl_crtp_fault_cfg_t cfg;
    uint64_t             cut_until_us;  ///< until then every packet is lost
    uint32_t             n_seen[IVL_CRTP_DIRECTIONS], n_lost, n_duplicated, n_reordered;
    uint64_t             last_due_us[IVL_CRTP_DIRECTIONS];
    uint64_t             order;
    ivl_crtp_datagram_t *queue;  ///< heap by (due, order)
    size_t               n, capacity;
} ivl_crtp_faults_t;

/// How long a reordered packet is held back beyond its time.
#define IVL_CRTP_REORDER_HOLD_US 10000u

void ivl_crtp_faults_init(ivl_crtp_faults_t *faults);
void ivl_crtp_faults_free(ivl_crtp_faults_t *faults);

/// Nothing to do for any packet, and none under way.
bool ivl_crtp_faults_idle(const ivl_crtp_faults_t *faults, uint64_t now_us);

/// Packets under way at most, a power of two: 20 s, the longest delay, at 13,000 packets a second.  Another one is lost, as one is for which
/// there is no memory.
#define IVL_CRTP_UNDER_WAY_MAX 262144u

/// Send a packet on its way: 0, 1 or 2 of it will arrive.
void ivl_crtp_faults_put(ivl_crtp_faults_t *faults, uint64_t now_us, const ivl_crtp_datagram_t *datagram);

/// Next packet that has arrived.  @return false if none has
bool ivl_crtp_faults_take(ivl_crtp_faults_t *faults, uint64_t now_us, ivl_crtp_datagram_t *datagram);

/// When the next packet arrives; UINT64_MAX if none is under way.
uint64_t ivl_crtp_faults_next_us(const ivl_crtp_faults_t *faults);
#endif  // IVL_CRTP_FAULTS_H
