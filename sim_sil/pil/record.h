/// @file record.h
/// A flight core that writes down what it is asked and what it answers (ivl_port.h), for replay on another processor.
///
/// On request its sensors and operators fail: numbers that are none, too large, or denormal; poses and clocks that stand
/// still or run backwards; requests that come at a bad time or make no sense; policies and configurations out of range.
#ifndef IVL_RECORD_H
#define IVL_RECORD_H

#include <stddef.h>
#include <stdint.h>

/// @param[in] requests_path, replies_path  files to write; the replies begin with the greeting
/// @param[in] fault_norm  chance per tick that a fault begins, 0..1
/// @param[in] seed        of the faults
/// @param[out] error      one line, if the result is NULL
void *ivl_record_create(const char *requests_path, const char *replies_path, double fault_norm, uint64_t seed, char *error,
                        size_t error_size);

/// From now on the landings of a model (of ivl_sil_model_create) are recorded, one batch at a time and on one thread;
/// ticks during which the motors are latched off too.
void ivl_record_attach(void *recorder, void *model);

/// Closes the files.
/// @return 0, or -1 if not everything could be written or more than one thread flew
int ivl_record_close(void *recorder);

#endif  // IVL_RECORD_H
