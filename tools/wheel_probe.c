/// @file wheel_probe.c
/// Flies landings with a library that was compiled for another processor: what tools/test_wheel.py runs under emulation.
///
/// usage: wheel_probe PARAMS SPECS N OUTCOMES: files of raw numbers, in the layouts of ivl_sil_table
#include <stdio.h>
#include <stdlib.h>

#include "sil.h"

/// A whole file, or the end of the program.
static void *read_all(const char *path)
{
    FILE *file = fopen(path, "rb");
    if (file == NULL || fseek(file, 0, SEEK_END) != 0)
    {
        perror(path);
        exit(1);
    }
    const long size = ftell(file);
    void      *data = (size > 0) ? malloc((size_t)size) : NULL;
    rewind(file);
    if (data == NULL || fread(data, 1, (size_t)size, file) != (size_t)size)
    {
        perror(path);
        exit(1);
    }
    fclose(file);
    return data;
}

int main(int argc, char **argv)
{
    if (argc != 5)
    {
        fprintf(stderr, "usage: %s PARAMS SPECS N OUTCOMES\n", argv[0]);
        return 2;
    }
    char         error[256] = "";
    uint32_t     n_fields, item_size;
    const size_t n = strtoul(argv[3], NULL, 10);
    void        *model = ivl_sil_model_create(read_all(argv[1]), error, sizeof error);
    if (model == NULL || ivl_sil_table(IVL_SIL_TABLE_OUTCOME, &n_fields, &item_size) == NULL)
    {
        fprintf(stderr, "no model: %s\n", error);
        return 1;
    }
    void *outcomes = calloc(n, item_size);
    FILE *file = fopen(argv[4], "wb");
    if (outcomes == NULL || file == NULL || ivl_sil_rollouts(model, read_all(argv[2]), n, 2, outcomes, NULL) != 0)
    {
        perror(argv[4]);
        return 1;
    }
    const size_t n_written = fwrite(outcomes, item_size, n, file);
    return (fclose(file) == 0 && n_written == n) ? 0 : 1;
}
