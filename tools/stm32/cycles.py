"""Instructions and cycles of each tick of a recording, block by block, with the program's own code in unicorn.

Emulators have no cycle model: a cycle figure is the sum of the weights of the instructions that were executed, from the
Cortex-M4 technical reference manual (Arm 100166, table 3-1; FPU table of the same).  Three figures are given:

expected  no wait states (the flash accelerator hits), two cycles to refill the pipeline after a branch that is taken
worst     the manual's longest time of each instruction, every branch taken and refilled in three
bound     as worst, without prefetch and caches: five cycles for each 16-byte line of each block, and for each constant
          that is read from the flash

None includes interrupts, contention with DMA, or exception entry.
"""

from dataclasses import dataclass, field
from pathlib import Path

import capstone
import layout
import numpy as np
import unicorn
from capstone import arm as cs_arm
from elftools.elf.elffile import ELFFile
from recording import Recording
from unicorn import arm_const as uc_arm

FLASH, FLASH_SIZE = 0x08000000, 1 << 20
RAM, RAM_SIZE = 0x20000000, 128 << 10
SLOTS, SLOT_SIZE = RAM, 3072
INPUT, OUTPUT = RAM + 0xC000, RAM + 0xD000
STACK_TOP = RAM + RAM_SIZE
STOP = FLASH + FLASH_SIZE - 4
WAIT_STATES = 5
LINE = 16
N_PHASES = 9
_PAINT = b"\xa5" * 8192
_STATE_AT = 512  # in a slot, after the configuration


@dataclass
class Block:
    """A straight run of instructions and what it costs; a branch at its end costs more when it is taken."""

    end: int
    n: int
    expected: int
    expected_taken: int
    worst: int
    bound: int


@dataclass
class Tally:
    """Figures of the ticks that ended in one phase; lists have one element per tick."""

    n: list[int] = field(default_factory=list)
    expected: list[int] = field(default_factory=list)
    worst: list[int] = field(default_factory=list)
    bound: list[int] = field(default_factory=list)

    def add(self, other: "Tally") -> None:
        """Append the ticks of another recording."""
        for mine, more in zip(vars(self).values(), vars(other).values(), strict=True):
            mine.extend(more)


class Chip:
    """The flight core of a linked program, called function by function."""

    def __init__(self, program: Path) -> None:
        """Load the program's code and constants."""
        self._machine = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS)
        self._machine.ctl_set_cpu_model(uc_arm.UC_CPU_ARM_CORTEX_M4)
        self._machine.mem_map(FLASH, FLASH_SIZE, unicorn.UC_PROT_READ | unicorn.UC_PROT_EXEC)
        self._machine.mem_map(RAM, RAM_SIZE, unicorn.UC_PROT_READ | unicorn.UC_PROT_WRITE)
        with program.open("rb") as file:
            elf = ELFFile(file)
            for segment in elf.iter_segments("PT_LOAD"):
                if segment["p_filesz"] and segment["p_paddr"] >= FLASH:
                    self._machine.mem_write(segment["p_paddr"], segment.data())
            symbols = elf.get_section_by_name(".symtab")
            self._function = {s.name: s["st_value"] for s in symbols.iter_symbols() if s["st_info"].type == "STT_FUNC"}
        self._size = {name: layout.struct(program, name)[1] for name in ("ivl_cfg_t", "ivl_policy_t", "ivl_in_t")}
        used = max(
            self._size["ivl_cfg_t"] - _STATE_AT, _STATE_AT + layout.struct(program, "ivl_state_t")[1] - SLOT_SIZE
        )
        if used > 0:
            raise RuntimeError(f"{program}: configuration or state is {used} bytes larger than its place here")
        self._phase_at = next(leaf.offset for leaf in layout.struct(program, "ivl_out_t")[0] if leaf.name == "phase")
        self._decoder = capstone.Cs(capstone.CS_ARCH_ARM, capstone.CS_MODE_THUMB | capstone.CS_MODE_MCLASS)
        self._decoder.detail = True
        self._blocks: dict[tuple[int, int], Block] = {}
        self._trace: list[tuple[int, int]] = []
        self._machine.mem_write(STACK_TOP - len(_PAINT), _PAINT)
        self._machine.hook_add(unicorn.UC_HOOK_BLOCK, lambda _, address, size, __: self._trace.append((address, size)))

    def run(self, recorded: Recording, program: Path) -> dict[int, Tally]:
        """Carry out all requests of a recording; returns the tally of each phase."""
        requests = np.fromfile(recorded.requests, layout.dtype(program, "ivl_port_request_t"))
        tallies = {phase: Tally() for phase in range(N_PHASES)}
        for request, raw in zip(requests, requests.view(np.uint8).reshape(len(requests), -1), strict=True):
            payload = raw.tobytes()[8:]
            cfg = SLOTS + int(request["slot"]) * SLOT_SIZE
            state, operation = cfg + _STATE_AT, int(request["operation"])
            if operation == 1:
                self._machine.mem_write(cfg, payload[: self._size["ivl_cfg_t"]])
                self._call("ivl_init", cfg, state)
            elif operation == 2:
                self._machine.mem_write(INPUT, payload[: self._size["ivl_policy_t"]])
                self._call("ivl_policy_commit", cfg, state, INPUT)
            else:
                self._machine.mem_write(INPUT, payload[: self._size["ivl_in_t"]])
                self._call("ivl_step", cfg, state, INPUT, OUTPUT)
                self._add(tallies[self._machine.mem_read(OUTPUT + self._phase_at, 1)[0]])
        return tallies

    def used_stack(self) -> int:
        """Deepest stack of all calls so far, bytes."""
        painted = bytes(self._machine.mem_read(STACK_TOP - len(_PAINT), len(_PAINT)))
        return len(painted.lstrip(_PAINT[:1]))

    def _call(self, name: str, *arguments: int) -> None:
        for register, value in enumerate(arguments):
            self._machine.reg_write(uc_arm.UC_ARM_REG_R0 + register, value)
        self._machine.reg_write(uc_arm.UC_ARM_REG_SP, STACK_TOP)
        self._machine.reg_write(uc_arm.UC_ARM_REG_LR, STOP | 1)
        self._trace.clear()
        self._machine.emu_start(self._function[name] | 1, STOP)

    def _add(self, tally: Tally) -> None:
        n = expected = worst = bound = 0
        following = [address for address, _ in self._trace[1:]] + [STOP]
        for key, next_address in zip(self._trace, following, strict=True):
            block = self._blocks.get(key) or self._decode(key)
            n += block.n
            expected += block.expected if next_address == block.end else block.expected_taken
            worst += block.worst
            bound += block.bound
        tally.n.append(n)
        tally.expected.append(expected)
        tally.worst.append(worst)
        tally.bound.append(bound)

    def _decode(self, key: tuple[int, int]) -> Block:
        address, size = key
        code = bytes(self._machine.mem_read(address, size))
        instructions = list(self._decoder.disasm(code, address))
        if sum(i.size for i in instructions) != size:
            raise RuntimeError(f"{address:#x}: not all of the block could be decoded")
        block = weigh(instructions, address + size)
        self._blocks[key] = block
        return block


def weigh(instructions: list[capstone.CsInsn], end: int) -> Block:
    """Cost of a block."""
    expected = expected_taken = worst = literals = 0
    written: set[int] = set()  # FPU registers written by the instruction before
    for instruction in instructions:
        least, most, taken = cost(instruction)
        reads, writes = (set(registers) for registers in instruction.regs_access())
        hazard = 1 if written & reads else 0
        is_arithmetic = instruction.mnemonic.startswith("v") and not instruction.mnemonic.startswith(_FPU_MOVES)
        written = writes if is_arithmetic else set()
        expected += least + hazard
        expected_taken += taken + hazard
        worst += most + (1 if is_arithmetic else 0)
        literals += 1 if _is_literal(instruction) else 0
    lines = (end - 1) // LINE - instructions[0].address // LINE + 1
    bound = worst + WAIT_STATES * (lines + literals)
    return Block(end, len(instructions), expected, expected_taken, worst, bound)


_FPU_MOVES = ("vldr", "vstr", "vldm", "vstm", "vpush", "vpop", "vmov", "vmrs", "vmsr")
_BRANCHES = ("b", "bl", "bx", "blx", "cbz", "cbnz")


def cost(instruction: capstone.CsInsn) -> tuple[int, int, int]:
    """Cycles of one instruction: least (a branch is not taken), most, and least with a branch taken."""
    name = instruction.mnemonic.split(".")[0]
    operands = instruction.operands
    if name in ("vdiv", "vsqrt"):
        return 14, 14, 14
    if name.startswith(("vldm", "vstm", "vpush", "vpop", "ldm", "stm", "push", "pop")):
        return _cost_of_many(instruction, name)
    if name.startswith(("vldr", "vstr")):
        return 2, 2, 2
    if name.startswith(("ldrd", "strd")):
        return 3, 3, 3
    if name.startswith(("ldr", "str")):
        jumps = name.startswith("ldr") and operands[0].reg == cs_arm.ARM_REG_PC
        return (4, 5, 4) if jumps else (2, 2, 2)
    if name.startswith(("tbb", "tbh")):
        return 4, 5, 4
    if name in ("udiv", "sdiv"):
        return 7, 12, 7
    if name.startswith(("vfm", "vfn", "vmla", "vmls", "vnml")):
        return 3, 3, 3
    if name in _BRANCHES or instruction.group(capstone.CS_GRP_JUMP) or instruction.group(capstone.CS_GRP_CALL):
        return 1, 4, 3
    if name in ("mla", "mls"):
        return 2, 2, 2
    return 1, 1, 1


def _cost_of_many(instruction: capstone.CsInsn, name: str) -> tuple[int, int, int]:
    registers = [op.reg for op in instruction.operands if op.type == cs_arm.ARM_OP_REG]
    if not name.startswith(("push", "pop", "vpush", "vpop")):
        registers = registers[1:]  # the base
    words = sum(2 if instruction.reg_name(register).startswith("d") else 1 for register in registers)
    jumps = cs_arm.ARM_REG_PC in registers
    return 1 + words + (2 if jumps else 0), 1 + words + (3 if jumps else 0), 1 + words + (2 if jumps else 0)


def _is_literal(instruction: capstone.CsInsn) -> bool:
    return any(op.type == cs_arm.ARM_OP_MEM and op.mem.base == cs_arm.ARM_REG_PC for op in instruction.operands)
