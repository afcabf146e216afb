/// @file crtp_time.h
/// Which vehicle time belongs to a wall-clock time.  Three ways to go: at a multiple of real time, as fast as possible, or in lock-step with
/// the client.  Knows no clock: both times are arguments.
#ifndef IVL_CRTP_TIME_H
#define IVL_CRTP_TIME_H
#include <stdbool.h>
#include <stdint.h>

/// A process that was suspended does not catch up on more than this.
#define IVL_CRTP_BEHIND_US_MAX 250000u

typedef struct
{
    // parameters of group sil
    uint8_t  lockstep;      ///< time stands still until run_to_ms is written
    float    speed_factor;  ///< vehicle time per wall time; 0: as fast as possible
    uint32_t run_to_ms;     ///< vehicle time to reach
    uint16_t run_until;     ///< mask of what ends a run early: bit 0..7 entering that phase, bit 8 the landing's outcome becoming final

    // state
    uint32_t asked_ms;  ///< run_to_ms as written last: writing the same again asks for nothing new
    bool     running;   ///< lock-step: run_to_ms lies ahead
    bool     anchored;
    uint64_t wall_us, vehicle_us;  ///< paced: these two belong together
    uint32_t n_slipped;            ///< times that the process was too late to catch up
    uint64_t skipped_us;           ///< vehicle time that was left out then, since the reader last set it to 0
} ivl_crtp_time_t;

/// The parameters have been written: start from here.
void ivl_crtp_time_restart(ivl_crtp_time_t *time);

/// run_to_ms has been written.  @return true if the vehicle has to run for it
bool ivl_crtp_time_ask(ivl_crtp_time_t *time, uint64_t vehicle_us);

/// Ends a lock-step run where the vehicle is.
void ivl_crtp_time_stop(ivl_crtp_time_t *time, uint64_t vehicle_us);

/// Vehicle time to reach by now; UINT64_MAX: as far as possible.
uint64_t ivl_crtp_time_target_us(ivl_crtp_time_t *time, uint64_t wall_us, uint64_t vehicle_us);

/// Wall-clock time at which the vehicle's next millisecond is due; UINT64_MAX if it waits for the client.
uint64_t ivl_crtp_time_wake_us(const ivl_crtp_time_t *time, uint64_t vehicle_us);
#endif  // IVL_CRTP_TIME_H
