#include "world_reading_rows.h"

#define INTO(name, unit, into)                                                                                                             \
    static ivl_reading_t *into_##name(ivl_in_t *in)                                                                                        \
    {                                                                                                                                      \
        return &in->into;                                                                                                                  \
    }
IVL_SIM_READING_ROWS(INTO)
#undef INTO

#define ROW(row_name, row_unit, row_into)                                                                                                  \
    {.name = #row_name, .unit = row_unit, .truth = ivl_sim_truth_##row_name, .sensor = ivl_sim_sensor_##row_name, .into = into_##row_name},
static const ivl_sim_reading_row_t ROWS[] = {IVL_SIM_READING_ROWS(ROW)};
#undef ROW

_Static_assert(sizeof ROWS / sizeof ROWS[0] <= IVL_SIM_READINGS_MAX, "a place for each row");

const ivl_sim_reading_table_t ivl_sim_readings = {.row = ROWS, .n = sizeof ROWS / sizeof ROWS[0]};
