#!/bin/sh
# Checks the rules of the firmware core that a compiler does not know.
# usage: check_core.sh OBJECT_FOLDER...      each folder holds the objects of firmware/core, one compilation per folder
#
# In the source, comments aside: no heap, no random numbers of libc, no printing, no clock, no double, no number for
# gravity but the default in the table of parameters.  In the objects: nothing called from outside but what is listed here,
# and no variable that lives longer than a call.
set -eu
source_folder=firmware/core
words='malloc|calloc|realloc|free|alloca|rand|srand|random|printf|fprintf|snprintf|puts|time|clock|double|goto|setjmp'
called='sqrtf|fabsf|memcpy|memset|memcmp|memmove|_GLOBAL_OFFSET_TABLE_'
failed=0

fail() {
    printf 'error: %s\n' "$1" >&2
    failed=1
}

ls "$source_folder"/*.c > /dev/null || exit 1
for file in "$source_folder"/*.[ch]; do
    # the compiler removes comments and keeps the rest as it stands
    code=$(sed '/^ *# *include/d' "$file" | "${CC:-gcc}" -w -fpreprocessed -dD -E -P -x c -)
    found=$(printf '%s\n' "$code" | grep -nwE "$words" || true)
    [ -z "$found" ] || fail "$file: forbidden word: $found"
    if [ "$file" != "$source_folder/ivl_vars.h" ]; then
        found=$(printf '%s\n' "$code" | grep -nE '(^|[^0-9.])9\.8[0-9]*' || true)
        [ -z "$found" ] || fail "$file: gravity as a bare number: $found"
    fi
    found=$(grep -E '^ *# *include *<' "$file" | grep -vE '<(math|stddef|stdint|stdbool|string)\.h>' || true)
    [ -z "$found" ] || fail "$file: header that the core does not use: $found"
done

for folder in "$@"; do
    ls "$folder"/*.o > /dev/null || exit 1
    nm --defined-only --format=posix "$folder"/*.o | awk 'NF > 1 {print $1}' | sort -u > "$folder/defined.txt"
    found=$(nm --undefined-only --format=posix "$folder"/*.o | awk 'NF > 1 {print $1}' | sort -u |
        grep -vxE "$called" | grep -vxFf "$folder/defined.txt" | tr '\n' ' ' || true)
    [ -z "$found" ] || fail "$folder: calls to functions outside the core: $found"

    # sections of variables (name, size); tables of constant addresses are in .data.rel.ro
    found=$(objdump --section-headers "$folder"/*.o |
        awk '$2 ~ /^\.(data|bss|tdata|tbss)/ && $2 !~ /^\.data\.rel\.ro/ && $3 !~ /^0+$/ {print $2, $3}' | tr '\n' ' ')
    [ -z "$found" ] || fail "$folder: global or static variables: $found"
done
exit $failed
