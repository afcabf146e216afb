#!/bin/sh
# Runs one Unity test program: one line when it passes, everything that it printed when it does not.
# usage: [RUNNER=COMMAND] [TIMEOUT_S=900] [KILL_S=10] run_unity.sh PROGRAM
# Fails on a failed test, a crash, an ignored test, no test at all, and on a program that does not end in time.
set -eu
program=$1
runner=${RUNNER:-}
time_s=${TIMEOUT_S:-900}

status=0
timeout --kill-after="${KILL_S:-10}" "$time_s" $runner "$program" > "$program.log" 2>&1 || status=$?
summary=$(grep -E '^[0-9]+ Tests [0-9]+ Failures [0-9]+ Ignored' "$program.log" || true)
case $summary in
    '' | '0 Tests '* | *[1-9]' Ignored'* | *[1-9]0' Ignored'*) passed=false ;;
    *) passed=true ;;
esac
if [ "$status" -ne 0 ] || [ "$passed" = false ]; then
    cat "$program.log"
    if [ "$status" -eq 124 ] || [ "$status" -eq 137 ]; then
        echo "error: $program did not end within $time_s s" >&2
    fi
    echo "error: $program failed (exit code $status, summary '$summary')" >&2
    exit 1
fi
printf '  PASS  %s: %s\n' "$program" "$summary"
