#!/bin/sh
# Fuzzes from the corpus in the repository; inputs that reach something new are kept beside the program, in corpus/.
# usage: fuzz.sh PROGRAM RUNS [libFuzzer options]     needs the virtual environment, for the vehicle's parameters
set -eu
program=$1
runs=$2
shift 2
here=$(dirname "$program")
mkdir -p "$here/corpus"
"${IVL:-.venv/bin/ivl}" sil --write-model "$here/model.txt"
IVL_FUZZ_MODEL=$here/model.txt "$program" -runs="$runs" -max_len=400 -dict=tests/fuzz/crtp.dict -artifact_prefix="$here/" "$@" \
    "$here/corpus" tests/fuzz/corpus
