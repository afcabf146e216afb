"""What the object files of the flight core tell: flash, memory, worst stack, and rules that a compiler could break."""

import re
import subprocess
from pathlib import Path

import layout
from elftools.elf.elffile import ELFFile

ENTRIES = ("ivl_step", "ivl_init", "ivl_policy_commit", "ivl_cfg_check", "ivl_cfg_defaults")
STRUCTS = ("ivl_cfg_t", "ivl_state_t", "ivl_in_t", "ivl_out_t")
ALLOWED_CALLS = re.compile(r"mem(cpy|set|move|cmp)|__aeabi_mem(cpy|set|clr|move)[48]?")
_FORBIDDEN_CODE = re.compile(
    r"\tvfn?m[as]\.|\t\S+\.f64"
)  # fused multiply-add (chained vmla rounds twice and is exact), double
_FUNCTION = re.compile(r"^[0-9a-f]+ <([^>]+)>:$")
_INSTRUCTION = re.compile(r"^\s*[0-9a-f]+:\t(\S+)\t?([^@;]*)")
_BRANCH = re.compile(r"(?:bl?|b[a-z]{2}|cbn?z)(?:\.[nw])? (?:\w+, )?[0-9a-f]+ <([^>]+)>")
_WRITE, _ALLOC = 1, 2  # section flags
_INDIRECT = "a pointer"
_NOT_CONSTANT = 1 << 30


def flash_bytes(objects: list[Path]) -> int:
    """Code and constants of all objects, also those that a linker might drop."""
    return sum(_size_of(path, _ALLOC) for path in objects)


def variable_bytes(objects: list[Path]) -> int:
    """Variables that live longer than a call."""
    return sum(_size_of(path, _ALLOC | _WRITE) for path in objects)


def instance_bytes(program: Path) -> int:
    """Memory that the caller of one core provides: configuration, state, input, output."""
    return sum(layout.struct(program, name)[1] for name in STRUCTS)


def _size_of(path: Path, flags: int) -> int:
    with path.open("rb") as file:
        headers = [section.header for section in ELFFile(file).iter_sections()]
    return sum(h["sh_size"] for h in headers if h["sh_flags"] & flags == flags)


def broken_rules(objects: list[Path], prefix: str = "arm-none-eabi-") -> list[str]:
    """Calls out of the core and instructions that it must not contain; empty if all is well."""
    found = []
    code = _run(f"{prefix}objdump", "-d", "--no-show-raw-insn", *objects)
    if "ivl_step" not in code:
        raise RuntimeError("the disassembly does not contain ivl_step: nothing was checked")
    found += [f"instruction: {line.strip()}" for line in code.splitlines() if _FORBIDDEN_CODE.search(line)]
    names = [line.split() for line in _run(f"{prefix}nm", "--format=posix", *objects).splitlines()]
    defined = {words[0] for words in names if len(words) > 2 and words[1] not in "Uw"}
    used = {words[0] for words in names if len(words) > 1 and words[1] in "Uw"}
    found += [f"call: {name}" for name in sorted(used - defined) if not ALLOWED_CALLS.fullmatch(name)]
    return found


def worst_stack(program: Path, prefix: str = "arm-none-eabi-") -> dict[str, int]:
    """Worst stack of each entry of a linked program, bytes, from its machine code.

    Each function's frame is everything that its instructions take from the stack, as if all of them were executed.
    (The figures of gcc's -fstack-usage leave out arguments that are passed half in registers: 16 of 392 bytes of
    ivl_step.)  A call through a pointer may reach every function whose address stands among the constants.

    Raises:
        RuntimeError: Recursion, a frame of changing size, or a call that cannot be followed.
    """
    frames, calls = _call_graph(_run(f"{prefix}objdump", "-d", "--no-show-raw-insn", program))
    calls[_INDIRECT] = _addressed(program) & set(frames)
    return {entry: _depth(entry, frames, calls, ()) for entry in ENTRIES if entry in frames}


def _call_graph(disassembly: str) -> tuple[dict[str, int], dict[str, set[str]]]:
    frames: dict[str, int] = {}
    calls: dict[str, set[str]] = {}
    name, frame = "", 0
    for line in disassembly.splitlines():
        if head := _FUNCTION.match(line):
            name, frame = head[1], 0
            frames.setdefault(name, 0)  # static functions of several files may share a name: the largest of them counts
            calls.setdefault(name, set())
        elif code := _INSTRUCTION.match(line):
            frame += _taken_from_stack(code[1], code[2])
            frames[name] = max(frames[name], frame)
            if target := _BRANCH.match(f"{code[1]} {code[2]}"):
                called = target[1].split("+")[0]
                if called != name or code[1] == "bl":  # a plain branch into itself is a loop
                    calls[name].add(called)
            elif code[1] in ("blx", "bx") and code[2].strip() != "lr":
                calls[name].add(_INDIRECT)
    return frames, calls


def _taken_from_stack(mnemonic: str, operands: str) -> int:
    base = mnemonic.split(".")[0]
    if base in ("push", "vpush") or (base in ("stmdb", "vstmdb") and operands.startswith("sp!")):
        return _register_bytes(operands[operands.index("{") :])
    if base in ("sub", "subw") and (constant := re.match(r"sp, (?:sp, )?#(\d+)", operands)):
        return int(constant[1])
    if base.startswith("str") and (constant := re.search(r"\[sp, #-(\d+)\]!", operands)):
        return int(constant[1])
    if re.match(r"sp\b", operands) and base in ("sub", "subw", "mov", "bic", "and"):
        return _NOT_CONSTANT
    return 0


def _register_bytes(registers: str) -> int:
    total = 0
    for part in registers.strip("{} \t").split(","):
        first, _, last = part.strip().partition("-")
        count = int(last[1:]) - int(first[1:]) + 1 if last else 1
        total += count * (8 if first.startswith("d") else 4)
    return total


def _addressed(program: Path) -> set[str]:
    """Functions whose address stands among the constants of a linked program."""
    with program.open("rb") as file:
        elf = ELFFile(file)
        symbols = elf.get_section_by_name(".symtab").iter_symbols()
        by_address = {s["st_value"]: s.name for s in symbols if s["st_info"].type == "STT_FUNC"}
        constants = elf.get_section_by_name(".rodata")
        data = constants.data() if constants else b""
    words = (int.from_bytes(data[i : i + 4], "little") for i in range(0, len(data) - 3, 4))
    return {by_address[word] for word in words if word in by_address}


def _depth(name: str, frames: dict[str, int], calls: dict[str, set[str]], path: tuple[str, ...]) -> int:
    if name in path:
        raise RuntimeError(f"recursion: {' -> '.join((*path, name))}")
    if name != _INDIRECT and name not in frames:
        raise RuntimeError(f"{path[-1]}: calls {name}, whose code is not there")
    if name == _INDIRECT and not calls[name]:
        raise RuntimeError(f"{path[-1]}: calls through a pointer, but no constant holds the address of a function")
    if frames.get(name, 0) >= _NOT_CONSTANT:
        raise RuntimeError(f"{name}: the size of its stack frame is not constant")
    below = max((_depth(next_, frames, calls, (*path, name)) for next_ in calls[name]), default=0)
    return frames.get(name, 0) + below


def _run(*command: object) -> str:
    return subprocess.run([str(word) for word in command], check=True, capture_output=True, text=True).stdout
