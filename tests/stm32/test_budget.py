"""The tools that measure the core: they must find what they look for."""

import re
import subprocess
from pathlib import Path

import budget
import cycles
import objects
import parts
import pytest
import recording
from replay import ROOT

FLAGS = [
    "-std=c11", "-O1", "-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16", "-fno-math-errno",
    "-nostdlib", "-Wl,-e,ivl_step", "-Wl,-Ttext=0x08000000", "-Wl,--unresolved-symbols=ignore-all",
]  # fmt: skip


def compiled(tmp_path: Path, code: str, *more: str) -> Path:
    source, program = tmp_path / "code.c", tmp_path / "code.elf"
    source.write_text(code)
    subprocess.run(["arm-none-eabi-gcc", *FLAGS, *more, "-o", program, source], check=True)
    return program


@pytest.mark.parametrize(
    ("code", "found"),
    [
        ("float ivl_step(float a, float b, float c) { return __builtin_fmaf(a, b, c); }", "vfma"),
        ("float ivl_step(float a, double b) { return (float)(a * b); }", "__aeabi_d"),
        ("float sinf(float); float ivl_step(float a) { return sinf(a); }", "call: sinf"),
        ("void *malloc(unsigned); void *ivl_step(void) { return malloc(8); }", "call: malloc"),
    ],
)
def test_forbidden_code_is_found(tmp_path: Path, code: str, found: str) -> None:
    part = compiled(tmp_path, code, "-c")
    assert any(found in rule for rule in objects.broken_rules([part]))


def test_rounding_multiply_add_is_allowed(tmp_path: Path) -> None:
    part = compiled(
        tmp_path, "float ivl_step(float a, float b, float c) { return a * b + c; }", "-c", "-ffp-contract=off"
    )
    assert objects.broken_rules([part]) == []


def test_recursion_is_found(tmp_path: Path) -> None:
    code = "int f(int); __attribute__((noinline)) int g(int n) { return f(n - 1) + 1; }"
    code += (
        "__attribute__((noinline)) int f(int n) { return n ? g(n) * 3 : 0; } int ivl_step(int n) { return f(n) + 1; }"
    )
    with pytest.raises(RuntimeError, match="recursion: ivl_step -> f -> g -> f"):
        objects.worst_stack(compiled(tmp_path, code))


def test_stack_frame_of_changing_size_is_found(tmp_path: Path) -> None:
    code = "void use(char *); void ivl_step(int n) { char bytes[n]; use(bytes); }"
    with pytest.raises(RuntimeError, match="ivl_step: the size of its stack frame is not constant"):
        objects.worst_stack(compiled(tmp_path, code))


def test_stack_is_that_of_the_deepest_path_and_of_calls_through_constants(tmp_path: Path) -> None:
    code = """
    void use(volatile char *); __attribute__((noinline)) void leaf(int n) { volatile char b[200]; b[n] = 1; }
    __attribute__((noinline)) void small(int n) { volatile char b[8]; b[n] = 1; }
    typedef void (*call_t)(int); const call_t TABLE[] = {small, leaf};
    void ivl_step(int n) { volatile char b[40]; b[n] = 2; TABLE[n](n); b[0] = 1; }
    """
    stack = objects.worst_stack(compiled(tmp_path, code))["ivl_step"]
    assert 240 <= stack <= 264


def test_cycles_are_those_of_the_manual() -> None:
    decoder = cycles.capstone.Cs(
        cycles.capstone.CS_ARCH_ARM, cycles.capstone.CS_MODE_THUMB | cycles.capstone.CS_MODE_MCLASS
    )
    decoder.detail = True
    code = {
        "80ee200a": (14, 14, 14),  # vdiv.f32 s0, s0, s1
        "30ee200a": (1, 1, 1),  # vadd.f32 s0, s0, s1
        "00ee200a": (3, 3, 3),  # vmla.f32 s0, s0, s1
        "90ed000a": (2, 2, 2),  # vldr s0, [r0]
        "2ded048b": (5, 5, 5),  # vpush {d8, d9}
        "10b5": (3, 3, 3),  # push {r4, lr}
        "10bd": (5, 6, 5),  # pop {r4, pc}
        "7047": (1, 4, 3),  # bx lr
        "b0fbf1f0": (7, 12, 7),  # udiv r0, r0, r1
        "0818": (1, 1, 1),  # adds r0, r1, r0
        "0068": (2, 2, 2),  # ldr r0, [r0]
    }
    for text, cost in code.items():
        (instruction,) = decoder.disasm(bytes.fromhex(text), 0x08000000)
        assert cycles.cost(instruction) == cost, instruction


def test_two_ways_to_count_instructions_agree(build: Path, tmp_path: Path) -> None:
    program = build / "replay.elf"
    recorded = recording.record(tmp_path, 1500, seed=7)
    tallies = cycles.Chip(program).run(recorded, program)
    counts = budget._counts(program, recorded)
    calls = set()
    for number, name in enumerate(budget.PHASES):
        n, least, total, most = counts[name]
        tally = tallies[number]
        assert len(tally.n) == n
        if n:
            calls |= {least - min(tally.n), most - max(tally.n), (total - sum(tally.n)) / n}
    assert len(calls) == 1, "the emulated clock counts the call as well, which is always as long"
    assert 2 <= calls.pop() <= budget._CALL_INSTRUCTIONS


def test_growth_beyond_the_margin_is_an_error() -> None:
    accepted = dict.fromkeys(budget.MARGINS, 1000.0)
    assert budget.grown(dict(accepted), accepted, "x") == []
    for name, margin in budget.MARGINS.items():
        found = accepted | {name: 1000.0 * (1.0 + margin) + 1.0}
        (problem,) = budget.grown(found, accepted, "x")
        assert name in problem


def test_budgets_are_those_of_the_vehicle() -> None:
    within = dict(budget.LIMITS)
    assert budget.exceeded(within, budget.VEHICLE_BUILD) == []
    for name in within:
        (problem,) = budget.exceeded(within | {name: within[name] * 1.01}, budget.VEHICLE_BUILD)
        assert name in problem


def test_core_keeps_the_rules(build: Path) -> None:
    parts = sorted((build / "firmware" / "core").glob("*.o"))
    assert len(parts) == len(list((ROOT / "firmware" / "core").glob("*.c")))
    assert objects.broken_rules(parts) == []
    assert objects.variable_bytes(parts) == 0


def test_a_part_that_is_not_there_is_not_taken_out(tmp_path: Path) -> None:
    """The cost of a part is nothing when the core without it is the core with it."""
    header = tmp_path / "ivl_form.h"
    header.write_text("#define X_ALL(X) \\\n    X(one)  \\\n    X(two)  \\\n    X(three)\n", encoding="utf-8")
    parts._take_out(header, "    X(two)")
    assert header.read_text(encoding="utf-8") == "#define X_ALL(X) \\\n    X(one)  \\\n    X(three)\n"
    with pytest.raises(RuntimeError, match=r"ivl_form\.h: no row X\(two\)"):
        parts._take_out(header, "    X(two)")
    core = ROOT / "firmware" / "core"
    assert all((core / f"ivl_form_{name}.c").exists() for name in parts._FORMS)
    declared = re.findall(r"^\w.*?\b(ivl_level_out_\w+)\(", (core / "ivl_level_out.h").read_text(), re.MULTILINE)
    assert declared == re.findall(r"^\w.*?\b(ivl_level_out_\w+)\(", parts._NO_LEVEL_OUT, re.MULTILINE)


def test_of_functions_that_share_a_name_the_largest_counts() -> None:
    """Static functions of several files: each form of a policy has its own `decide`."""
    code = """00000000 <decide>:
   0:\tpush\t{r4, r5, r6, lr}
   4:\tbl\t100 <one>
00000020 <decide>:
  20:\tpush\t{r4, lr}
  24:\tbl\t200 <two>
"""
    frames, calls = objects._call_graph(code)
    assert frames == {"decide": 16}
    assert calls == {"decide": {"one", "two"}}
