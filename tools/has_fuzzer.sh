#!/bin/sh
# Succeeds if a compiler can link a libFuzzer program with the sanitizers.   usage: has_fuzzer.sh COMPILER
program=$(mktemp)
trap 'rm -f "$program"' EXIT
echo 'int LLVMFuzzerTestOneInput(const unsigned char *d, unsigned long n) { return d == 0 && n > 0; }' |
    "$1" -x c -fsanitize=fuzzer,address,undefined -o "$program" - 2> /dev/null
