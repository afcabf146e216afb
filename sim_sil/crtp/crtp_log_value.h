/// @file crtp_log_value.h
/// Log variables as they are sent.
#ifndef IVL_CRTP_LOG_VALUE_H
#define IVL_CRTP_LOG_VALUE_H
#include "cf/cf.h"

/// Value of a log variable as type `fetch`.  @return bytes
size_t ivl_crtp_log_value(const ivl_cf_log_t *row, uint8_t fetch, uint8_t *bytes);

/// Bytes of a type, half precision included; 0 for an unknown one.
size_t ivl_crtp_log_size(uint8_t type);
#endif  // IVL_CRTP_LOG_VALUE_H
