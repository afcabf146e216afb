#!/bin/sh
# Looks at the Cortex-M4F objects of core and app, and prints their sizes.
# usage: check_app.sh CROSS_PREFIX LIBRARY_FUNCTIONS OBJECT_FOLDER
#
# Nothing is called but what core and app define, what firmware/sdk declares, and the listed functions of the C library (so no double,
# no libm, no heap); no multiplication is fused with an addition; no frame in the stabilizer's task is larger than 256 bytes.
set -eu
cross=$1 library=$2 folder=$3
frame_max=256
failed=0

fail() {
    printf 'error: %s\n' "$1" >&2
    failed=1
}

"${cross}nm" --defined-only --format=posix "$folder"/*/*.o | awk 'NF > 1 {print $1}' | sort -u > "$folder/defined.txt"
grep -ohwE '[a-zA-Z_][a-zA-Z0-9_]*' firmware/sdk/*.h | sort -u > "$folder/declared.txt"
found=$("${cross}nm" --undefined-only --format=posix "$folder"/*/*.o | awk 'NF > 1 {print $1}' | sort -u | grep -vxE "$library|tumbleCheckEnabled" |
    grep -vxFf "$folder/defined.txt" | grep -vxFf "$folder/declared.txt" | tr '\n' ' ' || true)
[ -z "$found" ] || fail "$folder: calls to functions that are not declared: $found"

found=$("${cross}objdump" -d "$folder"/*/*.o | grep -cE 'vfn?m[as]' || true)
[ "$found" = 0 ] || fail "$folder: $found fused multiplications"

found=$(awk -v max=$frame_max '$2 > max && $1 !~ /app_main|app_packets/ {print $1 " (" $2 ")"}' "$folder"/*/*.su | tr '\n' ' ')
[ -z "$found" ] || fail "$folder: frames larger than $frame_max bytes: $found"

"${cross}size" "$folder"/*/*.o | awk '
    NR > 1 {n = split($6, path, "/"); text[path[n - 1]] += $1; data[path[n - 1]] += $2; bss[path[n - 1]] += $3}
    END {
        printf "  %-6s %8s %6s %8s  bytes\n", "", "flash", "data", "zeroed"
        for (name in text) printf "  %-6s %8d %6d %8d\n", name, text[name] + data[name], data[name], bss[name]
    }'
exit $failed
