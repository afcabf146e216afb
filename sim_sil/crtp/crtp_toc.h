/// @file crtp_toc.h
/// A table of contents: what a client downloads to learn names, types and numbers of parameters or log variables.
#ifndef IVL_CRTP_TOC_H
#define IVL_CRTP_TOC_H
#include "crtp_packet.h"

enum
{
    IVL_CRTP_NAME_MAX = 24  ///< group and name together, so that an item fits into a packet
};

typedef struct
{
    const char *group, *name;
    uint8_t     code;  ///< type byte as sent, flags included
} ivl_crtp_toc_item_t;

typedef struct
{
    uint8_t                    port;
    const ivl_crtp_toc_item_t *items;
    uint16_t                   n;
    uint32_t                   crc;  ///< of all names and codes in order: clients keep tables by it
} ivl_crtp_toc_t;

/// Checks a table and computes its CRC.
/// @param[out] error  one line, if the result is false: a name that is empty, too long or there twice, or too many items
bool ivl_crtp_toc_init(ivl_crtp_toc_t *toc, uint8_t port, const ivl_crtp_toc_item_t *items, size_t n, char *error, size_t error_size);

/// Number of an item.  @return false if there is none of that name
bool ivl_crtp_toc_find(const ivl_crtp_toc_t *toc, const char *group, const char *name, uint16_t *id);

/// Answer to a packet of channel 0: information (3) and item (2) of version 2.
/// @param[out] reply  information ends behind the CRC: a log table has two bytes to add
/// @return false if the request is malformed
bool ivl_crtp_toc_answer(const ivl_crtp_toc_t *toc, const ivl_crtp_packet_t *request, ivl_crtp_packet_t *reply);

enum
{
    IVL_CRTP_TOC_ITEM = 2,
    IVL_CRTP_TOC_INFO = 3
};
#endif  // IVL_CRTP_TOC_H
