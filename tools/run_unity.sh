#!/bin/sh
# Runs one Unity test program: one line when it passes, everything that it printed when it does not.
# usage: [RUNNER=COMMAND] run_unity.sh PROGRAM      fails on a failed test, a crash, an ignored test, or no test at all
set -eu
program=$1
runner=${RUNNER:-}

status=0
$runner "$program" > "$program.log" 2>&1 || status=$?
summary=$(grep -E '^[0-9]+ Tests [0-9]+ Failures [0-9]+ Ignored' "$program.log" || true)
case $summary in
    '' | '0 Tests '* | *[1-9]' Ignored'* | *[1-9]0' Ignored'*) passed=false ;;
    *) passed=true ;;
esac
if [ "$status" -ne 0 ] || [ "$passed" = false ]; then
    cat "$program.log"
    echo "error: $program failed (exit code $status, summary '$summary')" >&2
    exit 1
fi
printf '  PASS  %s: %s\n' "$program" "$summary"
