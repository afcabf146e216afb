#!/bin/sh
# Runs a program on the emulated STM32F405; its exit code is that of the program, or 124 after TIMEOUT_S (120) seconds.
# usage: run_stm32.sh PROGRAM.elf [WORD...]      the words are the program's command line
#
# The standard input is passed on to programs that read it; standard output is theirs alone, messages come on standard error.
# ICOUNT=1: the emulated clock advances by one nanosecond per instruction.
set -eu
program=$1
shift
semihosting=enable=on,target=native,arg=$(basename "$program")
for word in "$@"; do
    semihosting=$semihosting,arg=$word
done
exec timeout --foreground "${TIMEOUT_S:-120}" "${QEMU:-qemu-system-arm}" -M netduinoplus2 -display none -monitor none -serial none \
    ${ICOUNT:+-icount shift=0} -semihosting-config "$semihosting" -kernel "$program"
