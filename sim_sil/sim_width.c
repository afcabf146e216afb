#include "sim_width.h"

#include <stdatomic.h>

#include "world_hover.h"

typedef ivl_sim_work_t (*fly_t)(const ivl_sim_model_t *model, ivl_sim_source_t source, void *context);
typedef void (*hover_t)(const ivl_sim_model_t *model, const ivl_sim_hover_t *flights, size_t n, double period_s, size_t n_rows);

typedef struct
{
    int     lanes;
    fly_t   fly;
    hover_t hover;
} width_t;

enum
{
    BITS_PER_LANE = 64
};

#define WIDTHS_EVERYWHERE(X) X(2)
#if defined(__x86_64__)
#define WIDTHS(X) WIDTHS_EVERYWHERE(X) X(4) X(8)
#else
#define WIDTHS(X) WIDTHS_EVERYWHERE(X)
#endif

#define DECLARE(n)                                                                                                                         \
    ivl_sim_work_t ivl_sim_fly_lanes##n(const ivl_sim_model_t *model, ivl_sim_source_t source, void *context);                             \
    void           ivl_sim_hover_lanes##n(const ivl_sim_model_t *model, const ivl_sim_hover_t *flights, size_t n_flight, double period_s,  \
                                          size_t n_rows);
WIDTHS(DECLARE)

#define ROW(n) {n, ivl_sim_fly_lanes##n, ivl_sim_hover_lanes##n},
static const width_t TABLE[] = {WIDTHS(ROW)};

enum
{
    N_WIDTHS = sizeof TABLE / sizeof TABLE[0]
};

// the instruction sets are those of tools/native.mk
static bool machine_has(int lanes)
{
#if defined(__x86_64__)
    if (lanes == 8)
    {
        return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
    }
    if (lanes == 4)
    {
        return __builtin_cpu_supports("avx2");
    }
#endif
    return lanes == 2;
}

// lanes that were asked for; 0: the widest
static atomic_int asked_lanes;

static const width_t *chosen(void)
{
    const int asked = atomic_load_explicit(&asked_lanes, memory_order_relaxed);
    int       i = N_WIDTHS - 1;
    while (i > 0 && !((asked == 0 || asked == TABLE[i].lanes) && machine_has(TABLE[i].lanes)))
    {
        i--;
    }
    return &TABLE[i];
}

int ivl_sim_width_lanes(void)
{
    return chosen()->lanes;
}

bool ivl_sim_width_use(int bits)
{
    bool known = bits == 0;
    for (int i = 0; i < N_WIDTHS; i++)
    {
        known = known || (bits == BITS_PER_LANE * TABLE[i].lanes && machine_has(TABLE[i].lanes));
    }
    if (known)
    {
        atomic_store_explicit(&asked_lanes, bits / BITS_PER_LANE, memory_order_relaxed);
    }
    return known;
}

ivl_sim_work_t ivl_sim_fly(const ivl_sim_model_t *model, ivl_sim_source_t source, void *context)
{
    return chosen()->fly(model, source, context);
}

void ivl_sim_hover(const ivl_sim_model_t *model, const ivl_sim_hover_t *flights, size_t n, double period_s, size_t n_rows)
{
    chosen()->hover(model, flights, n, period_s, n_rows);
}
