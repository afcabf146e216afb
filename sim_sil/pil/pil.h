/// @file pil.h
/// Processor in the loop: the flight cores of a world run on an emulated chip, one tick per exchange of messages (ivl_port.h).
///
/// Each thread that flies gets a chip of its own; chips are started when they are needed and kept for the next batch.
#ifndef IVL_PIL_H
#define IVL_PIL_H

#include <stddef.h>
#include <stdint.h>

/// Starts the first chip, to see that it can be done.
/// @param[in] command  program and arguments, ending with NULL; it speaks ivl_port.h over its standard input and output
/// @param[out] error   one line, if the result is NULL
void *ivl_pil_create(const char *const command[], char *error, size_t error_size);

/// From now on the landings of a model (of ivl_sil_model_create) are decided on these chips.  Must outlive the model's use.
void ivl_pil_attach(void *pil, void *model);

/// Ticks decided on chips so far.
uint64_t ivl_pil_ticks(void *pil);

/// Number of chips.
uint32_t ivl_pil_chips(void *pil);

/// One line about the first chip that failed; what was flown since then is void.  "" if none has failed.
const char *ivl_pil_error(void *pil);

/// Ends the chips.
void ivl_pil_free(void *pil);

#endif  // IVL_PIL_H
