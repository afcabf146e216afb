/// @file crtp_model_file.h
/// The vehicle's parameters as text, one a line in the order of IVL_SIL_TABLE_PARAM:
///
///     ivl_sil_model 1
///     body.mass 0x1.18fc504816f00p-5
///     ...
///     end 87 3f1c9a02
///
/// Numbers are hexadecimal floating point, so that no bit is lost; `end` gives the number of parameters and the CRC-32 of all bytes before it.
#ifndef IVL_CRTP_MODEL_FILE_H
#define IVL_CRTP_MODEL_FILE_H
#include "sim_model.h"

/// @param[in] path    "-" is the standard input
/// @param[out] error  one line naming file, line and parameter, if the result is NULL
/// @return to be given to ivl_sil_model_free
ivl_sim_model_t *ivl_crtp_model_read(const char *path, char *error, size_t error_size);
#endif  // IVL_CRTP_MODEL_FILE_H
