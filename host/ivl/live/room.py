"""Surface, fence, places and shapes: what a page draws a vehicle against. They do not change in a run."""

from typing import Any

from ivl import shapes
from ivl.experiment import Experiment
from ivl.site import file as site_file
from ivl.world import World

_AXES = ("x", "y", "z")


def room_of(experiment: Experiment, world: World) -> dict[str, Any]:
    """The room of an experiment: that of its site, if it has one, else the simulator's."""
    values = world.params.values
    surface = world.surface
    data = {
        "experiment": experiment.name,
        "learner": experiment.learner.name,
        "gear": experiment.gear,
        "speed_mps": experiment.speed_mps,
        "angle_deg": experiment.angle_deg,
        "budget": experiment.budget,
        "surface": {"point_W_m": surface.point_W_m, "normal_W": surface.normal_W},
        "fence_m": [[values[f"firmware.fence_{a}_min"], values[f"firmware.fence_{a}_max"]] for a in _AXES],
        "shapes": {**shapes.geometry(world), "feet_at_rest_B_m": shapes.feet_at_rest_B_m(world)},
        "site": None,
    }
    return data if experiment.site is None else data | {"site": _site(site_file.load(experiment.site))}


def _site(site: site_file.SiteFile) -> dict[str, Any]:
    """What only a site file knows."""
    surface, battery = site.surface, site.battery
    return {
        "name": site.name,
        "board_m": [[-surface.before_m, surface.beyond_m], [-surface.right_m, surface.left_m]],
        "home_m": site.home_m,
        "emergency_m": site.emergency_m,
        "stop": site.stop,
        "battery": {"full_V": battery.full_V, "rest_V_min": battery.rest_V_min, "load_V_min": battery.load_V_min},
    }
