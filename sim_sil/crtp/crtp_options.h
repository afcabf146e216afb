/// @file crtp_options.h
/// The command line of ivl_sil.
#ifndef IVL_CRTP_OPTIONS_H
#define IVL_CRTP_OPTIONS_H
#include "crtp_faults.h"

enum
{
    IVL_CRTP_DECKS_MAX = 8
};

typedef struct
{
    const char          *model, *bind;
    uint16_t             port;
    bool                 has_control;
    uint16_t             control_port;
    unsigned             vehicles;
    float                speed_factor;
    bool                 lockstep;
    uint64_t             seed;
    uint32_t             packets_per_s;
    ivl_crtp_fault_cfg_t fault;
    unsigned             n_decks;
    const char          *deck[IVL_CRTP_DECKS_MAX];
    bool                 shows_tables;  ///< print parameters and log variables instead of flying
} ivl_crtp_options_t;

typedef enum
{
    IVL_CRTP_OPTIONS_RUN,
    IVL_CRTP_OPTIONS_HELP,  ///< the help has been printed
    IVL_CRTP_OPTIONS_WRONG  ///< an error has been printed
} ivl_crtp_options_result_t;

ivl_crtp_options_result_t ivl_crtp_options_parse(int argc, char **argv, ivl_crtp_options_t *options);
#endif  // IVL_CRTP_OPTIONS_H
