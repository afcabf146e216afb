"""Shapes of a vehicle in body axes, for whoever draws it."""

import math
from typing import Any

from ivl.world import World

HIP_SIGNS = ((1, -1), (-1, -1), (-1, 1), (1, 1))
"""Legs 1 front right, 2 rear right, 3 rear left, 4 front left: signs of x and y."""


def geometry(world: World) -> dict[str, Any]:
    """Sizes and places of plates, rotors and legs, m."""
    values = world.params.values
    plates = {
        name: [*(values[f"{name}.size_{axis}"] for axis in "xyz"), values[f"{name}.center_z"]]
        for name in ("prop_plate", "base_plate")
    }
    return {
        **plates,
        "rotor": [values["rotor.x"], values["rotor.y"], values["rotor.z"], values["aero.rotor_radius"]],
        "hip": [values["leg.hip_xy"], values["leg.hip_z"]],
        "foot_radius": values["leg.foot_radius"],
        "leg_length": values["leg.length"],
        "sensed_gap_offset": values["world.sensed_gap_offset"],
    }


def feet_at_rest_B_m(world: World) -> list[list[float]]:
    """Feet of legs that nothing bends, in body axes, m."""
    values = world.params.values
    length_m, angle_rad = values["leg.length"], math.radians(values["leg.angle"])
    out_m = values["leg.hip_xy"] + length_m * math.sin(angle_rad) / math.sqrt(2.0)
    z_m = values["leg.hip_z"] - length_m * math.cos(angle_rad)
    return [[i * out_m, j * out_m, z_m] for i, j in HIP_SIGNS]
