/// @file ivl_form_bilinear.c
/// For every approach: the threshold of RREV is a table over the sensed velocities, bilinear between its nodes.
#include "ivl_general.h"
#include "ivl_math.h"

enum
{
    NODES_X = 5,  // v_x = 0, 1 .. 4 m/s
    NODES_Z = 6,  // v_z = 0, 0.8 .. 4 m/s
    N_NODES = NODES_X * NODES_Z,
};

static const float PER_STEP_X = 1.0f;
static const float PER_STEP_Z = 1.25f;

#define ROW_NAMES(x)   "r_" #x "0_per_s r_" #x "1_per_s r_" #x "2_per_s r_" #x "3_per_s r_" #x "4_per_s r_" #x "5_per_s"
#define ROW_SYMBOLS(x) "R_" #x "0 R_" #x "1 R_" #x "2 R_" #x "3 R_" #x "4 R_" #x "5"

static const ivl_form_group_t GROUPS[] = {
    {N_NODES, 0.5f, 20.0f,
     IVL_FORM_TEXT(1.0f, "1/s", ROW_NAMES(0) " " ROW_NAMES(1) " " ROW_NAMES(2) " " ROW_NAMES(3) " " ROW_NAMES(4),
                   ROW_SYMBOLS(0) " " ROW_SYMBOLS(1) " " ROW_SYMBOLS(2) " " ROW_SYMBOLS(3) " " ROW_SYMBOLS(4),
                   "threshold of RREV at v_x = 0, 1 .. 4 m/s (first digit) and v_z = 0, 0.8 .. 4 m/s (second digit)")},
    IVL_GENERAL_GROUPS,
};

/// A place between two nodes: the lower one, and how far it is on the way to the next.
typedef struct
{
    int   node;
    float part;
} place_t;

static place_t place(float steps, int n_nodes)
{
    const float within = ivl_clamp(steps, 0.0f, (float)(n_nodes - 1));
    const int   below = (int)within;
    const int   node = (below < n_nodes - 1) ? below : n_nodes - 2;
    return (place_t){node, within - (float)node};
}

static float along_z(const float row[], place_t z)
{
    return row[z.node] + z.part * (row[z.node + 1] - row[z.node]);
}

static float threshold_per_s(const float nodes[], const ivl_point_t *p)
{
    const place_t x = place(p->vx_mps * PER_STEP_X, NODES_X), z = place(p->vz_mps * PER_STEP_Z, NODES_Z);
    const float  *row = nodes + x.node * NODES_Z;
    const float   low = along_z(row, z), high = along_z(row + NODES_Z, z);
    return low + x.part * (high - low);
}

IVL_GENERAL_FORM(bilinear, N_NODES, "for every approach: threshold of RREV from a table over the sensed velocities, moment, go / no-go");
