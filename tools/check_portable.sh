#!/bin/sh
# Compiles the flight core as other firmware might, and checks what it calls.
#
# With gcc and clang of this machine, with and without optimisation, and with no flag that helps: nothing of libm.  With
# clang for macOS (arm64 and x86-64), as C and each header as C++, with every warning of clang but those named below.  There
# is no SDK of macOS here: in the place of its headers are those of tests/portable, which have what the core may use.
set -eu
work=build/portable
clang=${CLANG:-clang-14}
allowed='memcpy|memset|memcmp|memmove|bzero|_GLOBAL_OFFSET_TABLE_'
# of -Weverything: what is meant as it is.  A range is checked in the positive form, numbers are cast where they are computed,
# padding and C11 are wanted, a switch lists its cases and has a default beside, comments document several names at once
quiet='-Wno-padded -Wno-declaration-after-statement -Wno-float-equal -Wno-switch-default -Wno-covered-switch-default
       -Wno-bad-function-cast -Wno-documentation'
failed=0

refuse() {
    printf 'error: %s calls what the flight core must not: %s\n' "$1" "$2" >&2
    failed=1
}

rm -rf "$work"
for compiler in "${CC:-gcc}" "$clang"; do
    for level in -O0 -O2; do
        folder=$work/$(basename "$compiler")$level
        mkdir -p "$folder"
        for source in firmware/core/*.c; do
            "$compiler" -std=c11 $level -ffp-contract=off -Wall -Wextra -Werror -c -o "$folder/$(basename "$source" .c).o" "$source"
        done
        nm --defined-only --format=posix "$folder"/*.o | awk 'NF > 1 {print $1}' | sort -u > "$folder/defined.txt"
        found=$(nm --undefined-only --format=posix "$folder"/*.o | awk 'NF > 1 {print $1}' | sort -u |
            grep -vxE "$allowed" | grep -vxFf "$folder/defined.txt" | tr '\n' ' ' || true)
        [ -z "$found" ] || refuse "$compiler $level" "$found"
    done
done

for target in arm64-apple-macos12 x86_64-apple-macos12; do
    folder=$work/$target
    mkdir -p "$folder"
    for source in firmware/core/*.c; do
        "$clang" -target $target -nostdlibinc -std=c11 -O2 -ffp-contract=off -Weverything $quiet -Werror -isystem tests/portable \
            -S -o "$folder/$(basename "$source" .c).s" "$source"
    done
    found=$(cat "$folder"/*.s | awk '$1 ~ /^(b|bl|callq|jmp)$/ && $2 ~ /^_/ {print substr($2, 2)}' | sort -u |
        grep -vxE "$allowed|ivl_.*" | tr '\n' ' ' || true)
    [ -z "$found" ] || refuse "$target" "$found"
    # one call at least was seen, or the search above finds nothing whatever is called
    grep -qE '(bl|callq)[[:space:]]+_ivl_' "$folder/ivl_step.s" || { echo "error: $target: no calls were found" >&2; failed=1; }
    printf '#include "ivl.h"\nint main() { ivl_cfg_t cfg; ivl_cfg_defaults(&cfg); return ivl_cfg_check(&cfg); }\n' > "$folder/one.cpp"
    "$clang" -target $target -nostdlibinc -x c++ -std=c++17 -Wall -Wextra -Werror -nostdinc++ -isystem tests/portable -isystem firmware/core \
        -fsyntax-only "$folder/one.cpp"
done
exit $failed
