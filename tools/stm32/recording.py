"""Landings of the simulator, recorded as requests to the flight core and its replies here (sim_sil/pil/record.h)."""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import ivl
from ivl import forms, native

GEARS = ("extra_narrow_short", "narrow_short", "wide_short", "extra_narrow_long", "narrow_long", "wide_long")
VEHICLES = ("habas2021", "crazyflie21", "crazyflie21_brushless")
_FORMS = ("polynomial2", "polynomial3", "bilinear")
_GENERAL_SHARE = 0.5
_ERROR_BYTES = 256
_ROLLOUTS = 12  # of a batch, which has one vehicle, one gear and one set of parameters


@dataclass(frozen=True)
class Recording:
    """Two files with as many records: what was asked, and (after the greeting) what was answered."""

    requests: Path
    replies: Path


def record(
    folder: Path,
    n_ticks: int,
    seed: int,
    fault_norm: float = 0.01,
    source: int | None = None,
    form: str | None = None,
) -> Recording:
    """Fly until `n_ticks` or more are recorded: six gears in turn, each batch with parameters and faults of its own.

    Args:
        folder: Where the two files go.
        n_ticks: Least number of ticks.
        seed: Of everything random.
        fault_norm: Chance per tick that a fault begins.
        source: `firmware.d_source` of all batches; None: each draws its own.
        form: Form of the policies of all batches; None: each draws its own.
    """
    recording = Recording(folder / f"requests-{seed}.bin", folder / f"replies-{seed}.bin")
    rng = np.random.default_rng(seed)
    n_batch, flown = 0, 0
    with _recorder(recording, fault_norm, seed) as attach:
        while flown < n_ticks:
            gear, vehicle = GEARS[n_batch % len(GEARS)], VEHICLES[n_batch // len(GEARS) % len(VEHICLES)]
            world = ivl.World(vehicle, gear, "as_simulated", **_overrides(rng), **_sensing(rng, source))
            attach(world)
            flown += _fly(world, rng, form)
            n_batch += 1
    return recording


def _fly(world: ivl.World, rng: np.random.Generator, asked: str | None) -> int:
    """One batch with random approaches and policies; returns its ticks."""
    start = str(rng.choice(["imparted", "flown", "at_trigger"]))
    distance = rng.uniform(0.05, 0.6, _ROLLOUTS) if start == "at_trigger" else None
    form = str(rng.choice(_FORMS)) if rng.random() < _GENERAL_SHARE else forms.PAPER
    form = asked or form
    outcomes = world.rollouts(
        rng.uniform(1.0, 4.0, _ROLLOUTS), rng.uniform(20.0, 90.0, _ROLLOUTS), *_policies(form, rng), form=form,
        seed=int(rng.integers(2**32)), start=start, d_ceil_m=distance, threads=1,
    )  # fmt: skip
    return int(outcomes.n_ticks.sum())


def _policies(form: str, rng: np.random.Generator) -> list[np.ndarray]:
    """Random numbers for each parameter of a form: most flip somewhere, a good part calls approaches off."""
    if form == forms.PAPER:
        return [rng.uniform(1.0, 7.0, _ROLLOUTS), rng.uniform(0.0, 12.0, _ROLLOUTS)]
    return [_values(p.name, form, rng) for p in forms.by_name(form).params]


def _values(name: str, form: str, rng: np.random.Generator) -> np.ndarray:
    if name.startswith("r_"):
        is_threshold = form == "bilinear" or name == "r_0_per_s"
        return rng.uniform(1.0, 7.0, _ROLLOUTS) if is_threshold else rng.normal(0.0, 0.5, _ROLLOUTS)
    if name.startswith("m_"):
        return rng.uniform(0.0, 10.0, _ROLLOUTS) if name == "m_0_Nmm" else rng.normal(0.0, 0.3, _ROLLOUTS)
    return rng.uniform(0.0, 1.0, _ROLLOUTS) if name == "go_p_min" else rng.normal(0.0, 2.0, _ROLLOUTS)


def _overrides(rng: np.random.Generator) -> dict[str, float]:
    """Noise, delays, and flight parameters all over their ranges; phases that end soon, so that all come often."""
    return {
        "sense.latency": rng.uniform(0.0, 0.03),
        "sense.position_noise": rng.uniform(0.0, 0.01),
        "sense.velocity_noise": rng.uniform(0.0, 0.1),
        "sense.attitude_noise": rng.uniform(0.0, 0.02),
        "sense.gyro_noise": rng.uniform(0.0, 0.1),
        "sense.accel_noise": rng.uniform(0.0, 1.0),
        "firmware.ready_s_min": rng.uniform(0.0, 0.2),
        "firmware.coast_s_max": rng.uniform(0.1, 0.5),
        "firmware.attached_s": rng.uniform(0.0, 0.3),
        "firmware.flip_s_max": rng.uniform(0.02, 0.5),
        "firmware.approach_s_max": rng.uniform(0.5, 3.0),
        "firmware.stale_s_max": rng.uniform(0.04, 0.2),
        "firmware.kp_pos_xy": rng.uniform(0.0, 4.0),
        "firmware.kp_pos_z": rng.uniform(0.2, 5.0),
        "firmware.kd_rate_xy": rng.uniform(0.0005, 0.004),
        "firmware.tilt_cmd_max": rng.uniform(0.1, 1.2),
        "firmware.cut_at_inverted": float(rng.integers(2)),
        "firmware.cut_on_contact": float(rng.integers(2)),
        "end.time_max": 4.0,
        "end.contact_time": rng.uniform(0.2, 1.0),
    }


def _sensing(rng: np.random.Generator, source: int | None) -> dict[str, float]:
    """A source of the distance, with all sensors that could serve it."""
    inertial = rng.integers(2)
    return {
        "firmware.d_source": float(rng.integers(4) if source is None else source),
        "firmware.d_predict": float(rng.integers(2)),
        "firmware.of_source": float(rng.integers(2)),
        "firmware.shape": float(rng.integers(4)),
        "firmware.rrev_delay": rng.uniform(0.0, 0.03),
        "firmware.range_delay": rng.uniform(0.0, 0.03),
        "firmware.accel_delay": rng.uniform(0.0, 0.02),
        "firmware.d_sigma_max": rng.uniform(0.05, 1.0),
        "firmware.d_old_max": rng.uniform(0.05, 0.5),
        "firmware.rrev_tau": rng.uniform(0.0, 0.1),
        "firmware.kf_gate": rng.uniform(1.0, 5.0),
        "sense.inertial": float(inertial),
        "sense.attitude_integrated": float(inertial),
        "sense.start_position_error": rng.uniform(0.0, 0.5),
        "sense.accel_bias": rng.uniform(0.0, 0.3),
        "sense.pose_drop": rng.uniform(0.0, 0.1),
        "rrev.rate": rng.uniform(20.0, 200.0),
        "rrev.delay": rng.uniform(0.0, 0.03),
        "rrev.noise": rng.uniform(0.0, 0.2),
        "rrev.noise_rel": rng.uniform(0.0, 0.1),
        "rrev.max": 20.0,
        "rrev.drop": rng.uniform(0.0, 0.1),
        "range.rate": rng.uniform(0.0, 100.0),
        "range.delay": rng.uniform(0.0, 0.03),
        "range.noise": rng.uniform(0.0, 0.03),
        "flow.rate": rng.uniform(0.0, 100.0),
    }


@contextmanager
def _recorder(recording: Recording, fault_norm: float, seed: int) -> Iterator:
    c = native.library().c
    c.ivl_record_create.restype = ctypes.c_void_p
    text = ctypes.c_char_p
    c.ivl_record_create.argtypes = [text, text, ctypes.c_double, ctypes.c_uint64, text, ctypes.c_size_t]
    c.ivl_record_attach.argtypes = [ctypes.c_void_p] * 2
    c.ivl_record_close.argtypes = [ctypes.c_void_p]
    error = ctypes.create_string_buffer(_ERROR_BYTES)
    paths = [str(path).encode() for path in (recording.requests, recording.replies)]
    handle = c.ivl_record_create(*paths, fault_norm, seed, error, _ERROR_BYTES)
    if not handle:
        raise OSError(error.value.decode())
    failed = True
    try:
        yield lambda world: c.ivl_record_attach(handle, world.native_model.handle)
        failed = False
    finally:
        status = c.ivl_record_close(handle)
    if not failed and status != 0:
        raise OSError(f"{recording.requests}: the recording could not be written completely")
