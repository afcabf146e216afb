"""Processor in the loop: the simulator flies, and an emulated STM32F405 decides each tick.

The chip is emulated by QEMU in a child process that runs the flight core's own object code for that processor; each
tick is one exchange over its standard input and output. Every worker thread has a chip of its own.
"""

import ctypes
import math
import os
import shutil
import time
import weakref
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ivl import native
from ivl.errors import ConfigError, RolloutError
from ivl.experiment import Experiment
from ivl.source import Flown, Plan, WorldSource
from ivl.world import World

IMAGE_ENV = "IVL_NATIVE_IMAGE"  # another build of the image, for example one with forms of one's own
IMAGE = native.DEFAULT_LIBRARY.parent / "stm32f405.elf"
QEMU_ENV = "IVL_QEMU"  # another emulator
_ERROR_BYTES = 256


def qemu_command(image: Path) -> list[str]:
    """Command line that runs `image` with its standard input and output as the only way in and out."""
    return [
        os.environ.get(QEMU_ENV, "qemu-system-arm"), "-M", "netduinoplus2", "-display", "none", "-monitor", "none",
        "-serial", "none", "-semihosting-config", "enable=on,target=native", "-kernel", str(image),
    ]  # fmt: skip


def image_of(uri: str) -> Path:
    """The image that a URI names: pil:// is the usual one, or that of IVL_NATIVE_IMAGE; pil:///path/of/image.elf.

    Raises:
        ConfigError: It is missing.
        RolloutError: The emulator is.
    """
    image = Path(uri.removeprefix("pil://") or os.environ.get(IMAGE_ENV, IMAGE))
    if not image.is_file():
        raise ConfigError(f"{uri}: {image} is missing: run `make firmware`")
    emulator = qemu_command(image)[0]
    if shutil.which(emulator) is None:
        raise RolloutError(
            f"{uri}: {emulator} is not installed (Debian: qemu-system-arm; or name another in {QEMU_ENV})"
        )
    return image


def measure(n_rollouts: int = 64) -> dict[str, float]:
    """Ticks per second of one emulated chip that decides the paper's vertical landings, and that against real time."""
    chips, world = Chips(qemu_command(image_of("pil://"))), World("habas2021", "wide_short", "as_simulated")
    chips.attach(world)
    began = time.perf_counter()
    world.rollouts(2.5, 90.0, 4.8, np.linspace(6.0, 10.0, n_rollouts), threads=1)
    elapsed_s = time.perf_counter() - began
    chips.check()
    rate = chips.n_ticks / elapsed_s
    return {"pil_ticks_per_s": rate, "pil_times_real_time": rate * world.derived()["tick_s"]}


class Chips:
    """Emulated chips that run flight cores; more are started when several threads fly at once."""

    def __init__(self, command: list[str]) -> None:
        """Start the first chip.

        Raises:
            RolloutError: It cannot be started, or does not speak our language.
        """
        self._c = _declare(native.library().c)
        words = (ctypes.c_char_p * (len(command) + 1))(*(word.encode() for word in command), None)
        message = ctypes.create_string_buffer(_ERROR_BYTES)
        handle = self._c.ivl_pil_create(words, message, _ERROR_BYTES)
        if not handle:
            raise RolloutError(message.value.decode())
        self._handle = ctypes.c_void_p(handle)
        self._finalizer = weakref.finalize(self, self._c.ivl_pil_free, self._handle)

    def attach(self, world: World) -> None:
        """Let the chips decide all landings of `world` from now on; the world keeps them alive."""
        self._c.ivl_pil_attach(self._handle, world.native_model.handle)
        weakref.finalize(world, _keep, self)

    def check(self) -> None:
        """Raise RolloutError if a chip has failed: what was flown since the last check is void."""
        message = bytes(self._c.ivl_pil_error(self._handle)).decode()
        if message:
            raise RolloutError(message)

    @property
    def n_ticks(self) -> int:
        """Ticks decided by chips so far."""
        return int(self._c.ivl_pil_ticks(self._handle))

    @property
    def n_chips(self) -> int:
        """Chips that were started."""
        return int(self._c.ivl_pil_chips(self._handle))


class PilSource:
    """The simulator with the flight core on emulated chips; a whole plan in one batch."""

    is_flown, vehicle = False, ""

    def __init__(self, uri: str, experiment: Experiment, threads: int | None = None, record: bool = False) -> None:
        """Fly the experiment's approach; `uri` is pil:// or pil:///path/of/image.elf.

        `record`: give what each flip recorded, too, of a second flight of the same rollout.

        Raises:
            ConfigError: The image is missing.
            RolloutError: The emulator cannot be started.
        """
        self.world = experiment.make_world()
        self.chips = Chips(qemu_command(image_of(uri)))
        self.chips.attach(self.world)
        self._source = WorldSource(self.world, experiment, threads, record)
        self.warnings: list[str] = []

    def fly(self, plan: Plan) -> Iterator[Flown]:
        """Fly the plan; one portion with everything.

        Raises:
            RolloutError: A chip failed; nothing of this plan is yielded.
        """
        for flown in self._source.fly(plan):
            self.chips.check()
            yield flown

    def battery_V(self) -> float:
        """Nothing that lasts: each rollout has a battery of its own."""
        return math.nan

    def close(self) -> None:
        """The chips end with the world that they fly."""


def _keep(_: Chips) -> None:
    """Holds a reference until a world is gone."""


def _declare(c: Any) -> Any:
    ptr, size, text = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_char_p
    for name, restype, argtypes in (
        ("ivl_pil_create", ptr, (ctypes.POINTER(text), text, size)),
        ("ivl_pil_attach", None, (ptr, ptr)),
        ("ivl_pil_ticks", ctypes.c_uint64, (ptr,)),
        ("ivl_pil_chips", ctypes.c_uint32, (ptr,)),
        ("ivl_pil_error", text, (ptr,)),
        ("ivl_pil_free", None, (ptr,)),
    ):
        function = getattr(c, name)
        function.restype, function.argtypes = restype, list(argtypes)
    return c
