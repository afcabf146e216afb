"""The vehicle of a `World`, written again for MuJoCo: it shares nothing but the parameters with the simulator.

Body: a free joint at the centre of mass. Leg: one body with two hinges at the hip, the first about the fixed sideways
axis, the second about an axis that the leg carries; MuJoCo composes them as the universal joint that they are. Foot: no
geometry; `flight.c` switches an equality constraint (a point of the leg held at a point of the world) on at touch.
Plates: boxes against a plane.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

# Legs and motors 1 front-right, 2 rear-right, 3 rear-left, 4 front-left: the signs of x, of y, and of the reaction
# torque about body z.
SIGNS = ((1, -1, -1), (-1, -1, 1), (-1, 1, -1), (1, 1, 1))
# The rod is thin: its moment of inertia about itself is this share of that across. MuJoCo needs a positive number.
_THIN = 1.0e-6
# Impedance of the plates' contact. The stiffness does not depend on it; it adds this share of the body's mass.
_PLATE_IMPEDANCE = 0.001
# MuJoCo's damper is linear. With this ratio a body that strikes with one corner at 2 m/s rebounds as under the
# Hunt-Crossley law (restitution 0.51).
_PLATE_DAMPING_RATIO = 0.21
# Parameters that this model leaves out: they must have these values.
_ABSENT = {
    "aero.drag_xy": 0.0,
    "aero.drag_z": 0.0,
    "aero.ceiling_gain": 0.0,
    "leg.adhesion": math.inf,
    "leg.stick_delay": 0.0,
    "leg.foot_damping": 0.0,
}

Vector = npt.NDArray[np.float64]


def build(p: Mapping[str, float]) -> str:
    """The MJCF text.

    Args:
        p: Value of every parameter by dotted name, as in `World.params.values`.

    Raises:
        ValueError: A parameter has a value that this model cannot represent.
    """
    for name, value in _ABSENT.items():
        if p[name] != value:
            raise ValueError(f"{name}: value {p[name]!r}: the MuJoCo model has only {value!r}")
    legs = "".join(_leg(p, i) for i in range(4))
    motors = "".join(_motor(p, i) for i in range(4))
    feet = "".join(f'<connect body1="leg{i + 1}" anchor="{_text(_foot(p, i))}" active="false"/>' for i in range(4))
    pairs = "".join(_contact(p, name) for name in ("prop_plate", "base_plate"))
    return f"""<mujoco>
  <compiler angle="radian" inertiafromgeom="false"/>
  <option gravity="{_text(gravity_S(p))}" integrator="RK4" cone="elliptic" solver="Newton" tolerance="1e-14"/>
  <size nuserdata="8"/>
  <default><geom contype="0" conaffinity="0"/></default>
  <worldbody>
    <geom name="ceiling" type="plane" size="0 0 1" pos="0 0 {p["world.ceiling_height"]!r}" quat="0 1 0 0"/>
    <body name="airframe">
      <freejoint/>
      <inertial pos="0 0 0" mass="{p["body.mass"]!r}"
        diaginertia="{p["body.inertia_xx"]!r} {p["body.inertia_yy"]!r} {p["body.inertia_zz"]!r}"/>
      {_plate(p, "prop_plate")}{_plate(p, "base_plate")}
      {motors}{legs}
    </body>
  </worldbody>
  <contact>{pairs}</contact>
  <equality>{feet}</equality>
  <actuator>{"".join(_thrust(p, i) for i in range(4))}</actuator>
</mujoco>"""


def turn_SW(p: Mapping[str, float]) -> Vector:
    """Rotation from the world's axes to those of the surface, whose z is its normal; MuJoCo's world has the latter."""
    theta = math.radians(p["surface.angle"])
    normal, forward = (
        np.array([math.sin(theta), 0.0, -math.cos(theta)]),
        np.array([-math.cos(theta), 0.0, -math.sin(theta)]),
    )
    return np.array([forward, np.cross(normal, forward), normal])


def gravity_S(p: Mapping[str, float]) -> Vector:
    """Gravity in the axes of the surface."""
    return turn_SW(p) @ np.array([0.0, 0.0, -p["world.gravity"]])


def rest_direction(p: Mapping[str, float], leg: int) -> Vector:
    """Unit vector from hip to foot at rest, body axes."""
    psi = math.radians(p["leg.angle"])
    sx, sy, _ = SIGNS[leg]
    return np.array([sx * math.sin(psi) / math.sqrt(2), sy * math.sin(psi) / math.sqrt(2), -math.cos(psi)])


def plate_effective_mass(p: Mapping[str, float]) -> float:
    """Mass felt by a force along z at a corner of the propeller plate, legs left out, kg."""
    x, y = 0.5 * p["prop_plate.size_x"], 0.5 * p["prop_plate.size_y"]
    return 1.0 / (1.0 / p["body.mass"] + y * y / p["body.inertia_xx"] + x * x / p["body.inertia_yy"])


def _hip(p: Mapping[str, float], leg: int) -> Vector:
    sx, sy, _ = SIGNS[leg]
    return np.array([sx * p["leg.hip_xy"], sy * p["leg.hip_xy"], p["leg.hip_z"]])


def _foot(p: Mapping[str, float], leg: int) -> Vector:
    """Centre of the foot in the leg's frame (origin at the hip, axes of the airframe at rest)."""
    return p["leg.length"] * rest_direction(p, leg)


def _leg(p: Mapping[str, float], leg: int) -> str:
    """Rod and foot as one rigid body; mass, centre and inertia from the parallel-axis theorem."""
    n = rest_direction(p, leg)
    rod, foot, length = p["leg.mass"], p["leg.foot_mass"], p["leg.length"]
    centre = (0.5 * rod + foot) * length / (rod + foot)
    across = rod * length**2 / 12 + rod * (0.5 * length - centre) ** 2 + foot * (length - centre) ** 2
    inertia = across * (np.eye(3) - np.outer(n, n)) + _THIN * across * np.outer(n, n)
    full = [inertia[0, 0], inertia[1, 1], inertia[2, 2], inertia[0, 1], inertia[0, 2], inertia[1, 2]]
    sx, sy, _ = SIGNS[leg]
    sideways = np.array([-sy, sx, 0.0]) / math.sqrt(2)
    spring = f'stiffness="{p["leg.stiffness"]!r}" damping="{p["leg.damping"]!r}" armature="0"'
    return f"""<body name="leg{leg + 1}" pos="{_text(_hip(p, leg))}">
        <joint type="hinge" axis="{_text(sideways)}" {spring}/>
        <joint type="hinge" axis="{_text(np.cross(sideways, n))}" {spring}/>
        <inertial pos="{_text(centre * n)}" mass="{rod + foot!r}" fullinertia="{_text(full)}"/>
        <site name="foot{leg + 1}" pos="{_text(_foot(p, leg))}"/>
      </body>"""


def _plate(p: Mapping[str, float], name: str) -> str:
    half = [0.5 * p[f"{name}.size_{axis}"] for axis in "xyz"]
    return f'<geom name="{name}" type="box" size="{_text(half)}" pos="0 0 {p[f"{name}.center_z"]!r}"/>'


def _contact(p: Mapping[str, float], name: str) -> str:
    """The pair's parameters are placeholders until `plate_reference` knows what MuJoCo divides by."""
    imp = f"{_PLATE_IMPEDANCE} {_PLATE_IMPEDANCE} 0.001 0.5 1"
    mu = p["plate.friction"]
    return f'<pair geom1="ceiling" geom2="{name}" condim="3" solref="-1 -1" solimp="{imp}" friction="{mu} {mu} 0 0 0"/>'


def plate_reference(p: Mapping[str, float], inverse_weight: float) -> tuple[float, float]:
    """MuJoCo's direct `solref` (minus stiffness, minus damping) of a corner with the stiffness of the parameters.

    MuJoCo scales by its own estimate of the inverse mass and by the impedance; the inverse of that scale stands here,
    so that a corner at rest pushes with stiffness times depth.

    Args:
        p: Parameters by dotted name.
        inverse_weight: `body_invweight0` of the airframe, 1/kg.
    """
    stiffness = p["plate.stiffness"]
    damping = 2.0 * _PLATE_DAMPING_RATIO * math.sqrt(stiffness * plate_effective_mass(p))
    scale = inverse_weight * (1.0 - _PLATE_IMPEDANCE)
    return -stiffness * scale, -damping * scale


def _motor(p: Mapping[str, float], i: int) -> str:
    sx, sy, _ = SIGNS[i]
    return f'<site name="motor{i + 1}" pos="{sx * p["rotor.x"]!r} {sy * p["rotor.y"]!r} {p["rotor.z"]!r}"/>'


def _thrust(p: Mapping[str, float], i: int) -> str:
    torque = SIGNS[i][2] * p["rotor.torque_constant"] * p["aero.yaw_torque"]
    return f'<general site="motor{i + 1}" gear="0 0 1 0 0 {torque!r}"/>'


def _text(values: Sequence[float] | Vector) -> str:
    return " ".join(repr(float(v)) for v in values)
