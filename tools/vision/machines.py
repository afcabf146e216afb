"""The estimator on other processors, emulated: the same bits, and instructions and stack of each picture.

    .venv/bin/python tools/vision/machines.py        # after `make -f tools/vision.mk`

The emulator is unicorn, whose processors are QEMU's.  Instructions are counted, not cycles, of which it has no model.
"""

import ctypes
import sys
from dataclasses import dataclass
from pathlib import Path

import capstone
import numpy as np
import numpy.typing as npt
import unicorn
from elftools.elf.elffile import ELFFile
from unicorn import arm64_const, arm_const, riscv_const

from ivl.camera import motion, native, textures

BUILD = Path("build/vision")
OUT_BYTES = 32
STACK_TOP, STACK_BYTES = 0x30010000, 0x10000
STOP = 0x08000000
PAGE = 0x1000
_PAINT = b"\xa5"


@dataclass(frozen=True)
class Machine:
    """A processor of the emulator, and its decoder."""

    arch: int
    mode: int
    stack: int
    link: int
    decoder: tuple[int, int]
    arguments: tuple[int, ...]


MACHINES = {
    "rv32imac": Machine(
        unicorn.UC_ARCH_RISCV,
        unicorn.UC_MODE_RISCV32,
        riscv_const.UC_RISCV_REG_SP,
        riscv_const.UC_RISCV_REG_RA,
        (capstone.CS_ARCH_RISCV, capstone.CS_MODE_RISCV32 | capstone.CS_MODE_RISCVC),
        (riscv_const.UC_RISCV_REG_A0, riscv_const.UC_RISCV_REG_A1, riscv_const.UC_RISCV_REG_A2),
    ),
    "cortex-m4": Machine(
        unicorn.UC_ARCH_ARM,
        unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS,
        arm_const.UC_ARM_REG_SP,
        arm_const.UC_ARM_REG_LR,
        (capstone.CS_ARCH_ARM, capstone.CS_MODE_THUMB | capstone.CS_MODE_MCLASS),
        (arm_const.UC_ARM_REG_R0, arm_const.UC_ARM_REG_R1, arm_const.UC_ARM_REG_R2),
    ),
    "aarch64": Machine(
        unicorn.UC_ARCH_ARM64,
        unicorn.UC_MODE_ARM,
        arm64_const.UC_ARM64_REG_SP,
        arm64_const.UC_ARM64_REG_LR,
        (capstone.CS_ARCH_ARM64, capstone.CS_MODE_ARM),
        (arm64_const.UC_ARM64_REG_X0, arm64_const.UC_ARM64_REG_X1, arm64_const.UC_ARM64_REG_X2),
    ),
}


class Emulated:
    """The estimator of a program, called picture by picture."""

    def __init__(self, name: str) -> None:
        """Load build/vision/<name>.elf."""
        machine = MACHINES[name]
        self._machine = machine
        self._thumb = 1 if name == "cortex-m4" else 0
        self._uc = unicorn.Uc(machine.arch, machine.mode)
        if name == "cortex-m4":
            self._uc.ctl_set_cpu_model(arm_const.UC_CPU_ARM_CORTEX_M4)
        if name == "aarch64":  # its registers of 128 bits, which the compiler copies with
            self._uc.reg_write(arm64_const.UC_ARM64_REG_CPACR_EL1, 3 << 20)
        with (BUILD / f"{name}.elf").open("rb") as file:
            elf = ELFFile(file)
            for segment in elf.iter_segments("PT_LOAD"):
                first = segment["p_vaddr"] // PAGE * PAGE
                size = -(-(segment["p_vaddr"] + segment["p_memsz"] - first) // PAGE) * PAGE
                self._uc.mem_map(first, size)
                self._uc.mem_write(segment["p_vaddr"], segment.data())
            symbols = elf.get_section_by_name(".symtab")
            self._at = {s.name: s["st_value"] for s in symbols.iter_symbols() if s.name.startswith("entry_")}
        self._uc.mem_map(STACK_TOP - STACK_BYTES, STACK_BYTES)
        self._uc.mem_map(STOP, PAGE)
        self._uc.mem_write(STACK_TOP - STACK_BYTES, _PAINT * STACK_BYTES)
        self._decoder = capstone.Cs(*machine.decoder)
        self._lengths: dict[tuple[int, int], int] = {}
        self._n = 0
        self._uc.hook_add(unicorn.UC_HOOK_BLOCK, self._count)

    def _count(self, uc: unicorn.Uc, address: int, size: int, _: object) -> None:
        key = (address, size)
        if key not in self._lengths:
            code = bytes(uc.mem_read(address, size))
            decoded = list(self._decoder.disasm_lite(code, address))
            if sum(length for _, length, _, _ in decoded) != size:
                raise RuntimeError(f"{address:#x}: an instruction that the decoder does not know")
            self._lengths[key] = len(decoded)
        self._n += self._lengths[key]

    def _call(self, name: str, *arguments: int) -> int:
        """Instructions of a call."""
        for register, value in zip(self._machine.arguments, arguments, strict=False):
            self._uc.reg_write(register, value & 0xFFFFFFFF)
        self._uc.reg_write(self._machine.stack, STACK_TOP)
        self._uc.reg_write(self._machine.link, STOP | self._thumb)
        self._n = 0
        self._uc.emu_start(self._at[name] | self._thumb, STOP)
        return self._n

    def begin(self, focal_q16: int, radial_q16: tuple[int, int]) -> None:
        """Set the estimator up."""
        self._call("entry_begin", focal_q16, *radial_q16)

    def step(self, picture: bytes, times: bytes, axes: bytes) -> tuple[bytes, int]:
        """What it says to a picture, and how many instructions it took."""
        for name, data in (("entry_pixels", picture), ("entry_times_us", times), ("entry_axes_q30", axes)):
            self._uc.mem_write(self._at[name], data)
        n = self._call("entry_step")
        return bytes(self._uc.mem_read(self._at["entry_out"], OUT_BYTES)), n

    def used_stack(self) -> int:
        """Deepest stack so far, bytes."""
        painted = bytes(self._uc.mem_read(STACK_TOP - STACK_BYTES, STACK_BYTES))
        return len(painted.lstrip(_PAINT))


class Host:
    """The same on this computer."""

    def __init__(self) -> None:
        """Load build/vision/host.so."""
        self._c = ctypes.CDLL(str((BUILD / "host.so").resolve()))

    def begin(self, focal_q16: int, radial_q16: tuple[int, int]) -> None:
        """Set the estimator up."""
        if not self._c.entry_begin(focal_q16, *radial_q16):
            raise RuntimeError("the estimator refuses the camera")

    def step(self, picture: bytes, times: bytes, axes: bytes) -> tuple[bytes, int]:
        """What it says to a picture."""
        for name, data in (("entry_pixels", picture), ("entry_times_us", times), ("entry_axes_q30", axes)):
            ctypes.memmove(ctypes.addressof(ctypes.c_uint8.in_dll(self._c, name)), data, len(data))
        self._c.entry_step()
        return ctypes.string_at(ctypes.addressof(ctypes.c_uint8.in_dll(self._c, "entry_out")), OUT_BYTES), 0


@dataclass(frozen=True)
class Sequence:
    """Pictures of an approach as the estimator gets them."""

    focal_q16: int
    radial_q16: tuple[int, int]
    frames: list[tuple[bytes, bytes, bytes]]


def _fixed(values: npt.NDArray[np.float64], bits: int) -> npt.NDArray[np.int32]:
    return np.floor(values * 2.0**bits + 0.5).astype(np.int32)


def sequence(texture: str, seed: int, angle_deg: float = 50.0, n: int = 0, **camera_numbers: float) -> Sequence:
    """An oblique approach with a swinging body; `n` pictures of it, 0: all."""
    camera = native.Camera(**{"vignetting": 0.0, **camera_numbers})
    approach = motion.Approach(2.5, np.deg2rad(angle_deg), rrev_per_s=(1.5, 6.5))
    flown = motion.fly(approach, np.random.default_rng(seed))
    rows = flown.rows[-n:]
    grey = native.look(camera, textures.make(texture), rows, seed=seed, pictures=True).pictures
    assert grey is not None
    frames = []
    for i, row in enumerate(rows):
        told, last = row[14:18], rows[max(i - 1, 0), 14:18]
        turn = motion.multiply(last * np.array([-1, -1, -1, 1]), told)
        normal = np.array(
            [2 * (told[0] * told[2] - told[1] * told[3]), 2 * (told[1] * told[2] + told[0] * told[3]), 0.0]
        )
        normal[2] = np.sqrt(1.0 - normal[0] ** 2 - normal[1] ** 2)
        axes = _fixed(np.concatenate([turn * np.sign(turn[3]), normal]), 30)
        times = np.array([row[0] * 1e6, 4000], dtype=np.uint32)
        frames.append((grey[i].tobytes(), times.tobytes(), axes.tobytes()))
    radial = (int(_fixed(np.array(camera["radial_1"]), 16)), int(_fixed(np.array(camera["radial_2"]), 16)))
    return Sequence(int(camera["focal"] * 32768), radial, frames)


def play(estimator: Emulated | Host, seen: Sequence) -> tuple[list[bytes], list[int]]:
    """Answers to the pictures of a sequence, and instructions of each."""
    estimator.begin(seen.focal_q16, seen.radial_q16)
    answers = [estimator.step(*frame) for frame in seen.frames]
    return [answer for answer, _ in answers], [n for _, n in answers]


def main() -> int:
    """Print the figures of each processor; 1 if one of them has other bits."""
    different = False
    for name in MACHINES:
        emulated = Emulated(name)
        counts: list[int] = []
        for texture, camera in (("noise", {}), ("panels", {}), ("dots", {"radial_1": -0.15})):
            seen = sequence(texture, 1, **camera)
            answers, n = play(emulated, seen)
            different |= answers != play(Host(), seen)[0]
            counts += n
        print(
            f"{name:10s} {len(counts)} pictures: median {np.median(counts):.0f} instructions, most {max(counts)}; "
            f"stack {emulated.used_stack()} bytes{'; OTHER BITS' if different else ''}"
        )
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main())
