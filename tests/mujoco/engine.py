"""Landings in MuJoCo, stepped from C (`flight.c`), with starts and motor commands of the project's own landings."""

import ctypes
import hashlib
import os
import subprocess
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import mjcf
import mujoco
import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation  # type: ignore[import-untyped]

import ivl
from ivl.world import Trace

HERE = Path(__file__).resolve().parent
BUILD = HERE.parents[1] / "build" / "mujoco"
ROW_SIZE = 26
TICK_S = 0.002

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Steps:
    """How MuJoCo integrates.

    Attributes:
        integrator: MuJoCo's name of it: RK4, Euler, implicit, implicitfast.
        flight_s: Step before the first contact.
        touch_s: Step for `touch_time_s` after each contact.
        swing_s: Step from then on.
        touch_time_s: Duration of the short steps.
        locate: Cut steps at the instant of a touch (else a foot sticks at the end of the step).
        burst: Make the sticking impulse in steps of no length (else the steps that follow make it).
    """

    integrator: str = "RK4"
    flight_s: float = 5.0e-4
    touch_s: float = 1.0e-4
    swing_s: float = 2.5e-4
    touch_time_s: float = 0.05
    locate: bool = True
    burst: bool = True

    def scaled(self, factor: float) -> "Steps":
        """All steps longer (factor > 1) or shorter."""
        return replace(
            self, flight_s=self.flight_s * factor, touch_s=self.touch_s * factor, swing_s=self.swing_s * factor
        )


@dataclass(frozen=True)
class Flight:
    """One landing as MuJoCo flew it. World frame, SI; angles in degrees; NaN where nothing happened.

    Attributes:
        n_legs: Feet stuck at the end.
        leg_order: Legs 1..4 in the order of sticking, then 0.
        body_contact: The propeller plate touched.
        base_contact: The base plate touched.
        t_impact_s: Time of the first contact.
        theta_impact_deg: Nose-up rotation at that time, unwrapped.
        t_plate_s: Time of the first contact of a plate.
        n_steps: Integration steps.
        t_s: Times of the rows, shape (n,).
        p_m: Body origin, shape (n, 3).
        q_xyzw: Attitude, shape (n, 4).
        v_mps: Velocity, world axes, shape (n, 3).
        w_radps: Angular rate, body axes, shape (n, 3).
        feet_m: Centres of the feet, shape (n, 4, 3).
    """

    n_legs: int
    leg_order: tuple[int, ...]
    body_contact: bool
    base_contact: bool
    t_impact_s: float
    theta_impact_deg: float
    t_plate_s: float
    n_steps: int
    t_s: Array
    p_m: Array
    q_xyzw: Array
    v_mps: Array
    w_radps: Array
    feet_m: Array


class Input(ctypes.Structure):
    """`input_t` of flight.c."""

    _fields_ = [
        ("tick_s", ctypes.c_double),
        ("n_ticks", ctypes.c_int),
        ("integrator", ctypes.c_int),
        ("locate", ctypes.c_int),
        ("burst", ctypes.c_int),
        ("command_N", ctypes.c_void_p),
        ("scatter", ctypes.c_double * 4),
        ("speed_radps", ctypes.c_double * 4),
        *((name, ctypes.c_double) for name in ("k_thrust_Ns2", "tau_up_s", "tau_down_s", "ceiling_m", "foot_radius_m")),
        *((name, ctypes.c_double) for name in ("step_flight_s", "step_touch_s", "step_swing_s", "touch_time_s")),
    ]


class Output(ctypes.Structure):
    """`output_t` of flight.c."""

    _fields_ = [
        ("n_stuck", ctypes.c_int),
        ("order", ctypes.c_int * 4),
        ("plate_touched", ctypes.c_int * 2),
        ("n_steps", ctypes.c_int),
        ("failed", ctypes.c_int),
        ("t_plate_s", ctypes.c_double * 2),
        ("t_stuck_s", ctypes.c_double * 4),
        ("t_impact_s", ctypes.c_double),
        ("theta_impact_rad", ctypes.c_double),
        ("v_impact", ctypes.c_double * 6),
    ]


class Engine:
    """MuJoCo with the vehicle of one `ivl.World`. Not for several threads at once: make one for each."""

    def __init__(self, world: ivl.World, plates: str = "native") -> None:
        """Build model and data.

        Args:
            world: Its parameters are taken over.
            plates: "native": MuJoCo's contact of box and plane; "same_law": Hunt-Crossley corners, written again in C.
        """
        if plates not in ("native", "same_law"):
            raise ValueError(f"plates: value {plates!r} is unknown (allowed native, same_law)")
        p = self.params = world.params.values
        for name in ("rotor.drag_share", "rotor.inflow_loss", "battery.voltage"):
            if p[name] != 0.0:
                raise ValueError(f"{name}: value {p[name]!r}: the rotors written here have no such part (allowed 0)")
        if p["rotor.thrust_gain"] != 1.0:
            raise ValueError(f"rotor.thrust_gain: value {p['rotor.thrust_gain']!r} (allowed 1)")
        self.model = mujoco.MjModel.from_xml_string(mjcf.build(p))
        airframe = self.model.body("airframe").id
        self.model.pair_solref[:] = mjcf.plate_reference(p, float(self.model.body_invweight0[airframe, 0]))
        self.model.eq_solimp[:, :2] = 0.9999
        self.data = mujoco.MjData(self.model)
        self._R_SW = mjcf.turn_SW(p)
        self._point_m = np.array([0.0, 0.0, p["world.ceiling_height"]])  # of the surface, in both frames
        self._turn_deg = 180.0 - p["surface.angle"]  # a level vehicle is so much nose-up as seen from the surface
        self._law = [0.0] * 8
        if plates == "same_law":
            self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
            names = ("world.ceiling_height", "plate.stiffness", "plate.damping", "plate.friction", "plate.slip_speed")
            self._law = [1.0, *(p[name] for name in names), 0.0, 0.0]

    def prepare(self, trace: Trace, steps: Steps) -> tuple[Input, Array]:
        """The C input for the start and the commands of `trace` (period: one tick), and the array that it points to."""
        p, rows = self.params, trace.rows
        commands = np.ascontiguousarray(rows.thrust_cmd_N[1:])
        given = Input(tick_s=TICK_S, n_ticks=len(commands), locate=steps.locate, burst=steps.burst)
        given.integrator = int(getattr(mujoco.mjtIntegrator, f"mjINT_{steps.integrator.upper()}"))
        given.command_N = commands.ctypes.data
        mass = p["body.mass"] + 4 * (p["leg.mass"] + p["leg.foot_mass"])
        hover = mass * p["world.gravity"] / 4
        given.scatter = (ctypes.c_double * 4)(*(rows.thrust_N[0] / hover))
        given.speed_radps = (ctypes.c_double * 4)(*[float(np.sqrt(hover / p["rotor.thrust_constant"]))] * 4)
        given.k_thrust_Ns2, given.tau_up_s = p["rotor.thrust_constant"], p["rotor.tau_up"]
        given.tau_down_s = p["rotor.tau_down"]
        given.ceiling_m, given.foot_radius_m = p["world.ceiling_height"], p["leg.foot_radius"]
        given.step_flight_s, given.step_touch_s = steps.flight_s, steps.touch_s
        given.step_swing_s, given.touch_time_s = steps.swing_s, steps.touch_time_s
        return given, commands

    def reset(self, trace: Trace) -> None:
        """Place the vehicle as the first row of `trace` has it: legs at rest."""
        first = trace.rows[0]
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:3] = self._R_SW @ (first.p_WB_m - self._point_m) + self._point_m
        self.data.qpos[3:7] = np.roll((Rotation.from_matrix(self._R_SW) * Rotation.from_quat(first.q_WB)).as_quat(), 1)
        self.data.qvel[:3] = self._R_SW @ first.v_WB_mps
        self.data.qvel[3:6] = first.w_B_radps
        self.data.userdata[:] = self._law

    def fly(self, trace: Trace, steps: Steps | None = None) -> Flight:
        """Fly the landing of `trace` with its commands, for as long as it lasted.

        Raises:
            RuntimeError: MuJoCo found a state that is not finite.
        """
        given, commands = self.prepare(trace, steps or Steps())
        rows = np.empty((len(commands) + 1, ROW_SIZE))
        result = Output()
        self.reset(trace)
        run(self, given, result, rows.ctypes.data)
        return self._in_world(_flight(result, rows))

    def _in_world(self, flight: Flight) -> Flight:
        """A flight in the world's axes; MuJoCo has it in those of the surface."""
        back = self._R_SW.T
        return replace(
            flight,
            theta_impact_deg=flight.theta_impact_deg - self._turn_deg,
            p_m=(flight.p_m - self._point_m) @ self._R_SW + self._point_m,
            q_xyzw=(Rotation.from_matrix(back) * Rotation.from_quat(flight.q_xyzw)).as_quat(),
            v_mps=flight.v_mps @ self._R_SW,
            feet_m=(flight.feet_m - self._point_m) @ self._R_SW + self._point_m,
        )


def run(engine: Engine, given: Input, result: Output, rows: int | None) -> None:
    """Call `fly` of flight.c; releases the interpreter lock."""
    status = library().fly(engine.model._address, engine.data._address, ctypes.byref(given), ctypes.byref(result), rows)
    if status or result.failed:
        raise RuntimeError(f"MuJoCo: status {status}, bad state {result.failed}")


@cache
def library() -> ctypes.CDLL:
    """flight.c, compiled against the installed MuJoCo when either has changed.

    Raises:
        subprocess.CalledProcessError: The compiler failed.
    """
    package = Path(mujoco.__file__).parent
    engine = next(package.glob("libmujoco.so*"))
    source = HERE / "flight.c"
    digest = hashlib.sha256(source.read_bytes() + mujoco.__version__.encode() + str(package).encode()).hexdigest()[:16]
    target = BUILD / f"flight-{digest}.so"
    if not target.is_file():
        BUILD.mkdir(parents=True, exist_ok=True)
        part = target.with_suffix(f".{os.getpid()}")
        flags = ["-std=c11", "-O2", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared"]
        command = [os.environ.get("CC", "cc"), *flags, "-isystem", str(package / "include"), str(source), str(engine)]
        subprocess.run([*command, f"-Wl,-rpath,{package}", "-lm", "-o", str(part)], check=True)
        part.rename(target)
    c = ctypes.CDLL(str(target))
    c.fly.argtypes = [ctypes.c_void_p] * 5
    c.fly.restype = ctypes.c_int
    return c


def _flight(result: Output, rows: Array) -> Flight:
    plates = [t for t, touched in zip(result.t_plate_s, result.plate_touched, strict=True) if touched]
    hit = result.t_impact_s >= 0.0
    return Flight(
        n_legs=result.n_stuck,
        leg_order=tuple(result.order),
        body_contact=bool(result.plate_touched[0]),
        base_contact=bool(result.plate_touched[1]),
        t_impact_s=result.t_impact_s if hit else np.nan,
        theta_impact_deg=float(np.degrees(result.theta_impact_rad)) if hit else np.nan,
        t_plate_s=min(plates, default=np.nan),
        n_steps=result.n_steps,
        t_s=rows[:, 0],
        p_m=rows[:, 1:4],
        q_xyzw=np.roll(rows[:, 4:8], -1, axis=1),
        v_mps=rows[:, 8:11],
        w_radps=rows[:, 11:14],
        feet_m=rows[:, 14:].reshape(-1, 4, 3),
    )
