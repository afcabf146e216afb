#include "crtp_model_file.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "ivl_wire.h"
#include "sil.h"

enum
{
    PARAMS_MAX = 512,
    LINE_MAX_BYTES = 200
};

typedef struct
{
    FILE       *file;
    const char *path;
    char       *error;
    size_t      error_size;
    unsigned    line_number;
    uint32_t    crc;  ///< of the lines before this one
    char        line[LINE_MAX_BYTES];
} reader_t;

static bool fail(const reader_t *r, const char *what)
{
    snprintf(r->error, r->error_size, "%s:%u: %s", r->path, r->line_number, what);
    return false;
}

// the line without its end, and the CRC of all before it
static bool next_line(reader_t *r)
{
    if (r->line_number > 0u)
    {
        r->crc = ivl_wire_crc(r->crc, r->line, strlen(r->line));
        r->crc = ivl_wire_crc(r->crc, "\n", 1);
    }
    r->line_number++;
    if (fgets(r->line, sizeof r->line, r->file) == NULL)
    {
        return fail(r, "ends too early");
    }
    const size_t n = strcspn(r->line, "\n");
    if (r->line[n] != '\n')
    {
        return fail(r, "line is too long, or has no end");
    }
    r->line[n] = '\0';
    return true;
}

static bool read_value(reader_t *r, const char *name, double *value)
{
    char         what[LINE_MAX_BYTES];
    const size_t n = strlen(name);
    if (!next_line(r))
    {
        return false;
    }
    if ((strncmp(r->line, name, n) != 0) || (r->line[n] != ' '))
    {
        snprintf(what, sizeof what, "expected parameter %s, got '%.60s': written for another version of the simulator?", name, r->line);
        return fail(r, what);
    }
    char *end;
    *value = strtod(r->line + n + 1, &end);
    if ((end == r->line + n + 1) || (*end != '\0'))
    {
        snprintf(what, sizeof what, "%s: '%.60s' is no number", name, r->line + n + 1);
        return fail(r, what);
    }
    return true;
}

static bool read_all(reader_t *r, double *values)
{
    uint32_t               n, size;
    const ivl_sil_field_t *fields = ivl_sil_table(IVL_SIL_TABLE_PARAM, &n, &size);
    if ((n > PARAMS_MAX) || (size != n * sizeof *values))
    {
        return fail(r, "the simulator's parameters are not doubles, or too many");
    }
    if (!next_line(r))
    {
        return false;
    }
    if (strcmp(r->line, "ivl_sil_model 1") != 0)
    {
        return fail(r, "is no model file: the first line must be 'ivl_sil_model 1'");
    }
    for (uint32_t i = 0; i < n; i++)
    {
        if (!read_value(r, fields[i].name, &values[i]))
        {
            return false;
        }
    }
    char expected[LINE_MAX_BYTES];
    if (!next_line(r))
    {
        return false;
    }
    snprintf(expected, sizeof expected, "end %u %08x", (unsigned)n, (unsigned)r->crc);
    return (strcmp(r->line, expected) == 0) ? true : fail(r, "number of parameters or CRC differ: the file is damaged");
}

ivl_sim_model_t *ivl_crtp_model_read(const char *path, char *error, size_t error_size)
{
    static double values[PARAMS_MAX];
    const bool    is_stdin = strcmp(path, "-") == 0;
    reader_t      r = {.path = is_stdin ? "standard input" : path, .error = error, .error_size = error_size};
    r.file = is_stdin ? stdin : fopen(path, "r");
    if (r.file == NULL)
    {
        snprintf(error, error_size, "%s: %s", path, strerror(errno));
        return NULL;
    }
    const bool good = read_all(&r, values);
    if (!is_stdin)
    {
        fclose(r.file);
    }
    if (!good)
    {
        return NULL;
    }
    char             why[LINE_MAX_BYTES];
    ivl_sim_model_t *model = ivl_sil_model_create(values, why, sizeof why);
    if (model == NULL)
    {
        snprintf(error, error_size, "%s: %s", r.path, why);
    }
    return model;
}
