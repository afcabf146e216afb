"""Whether a site, an experiment and a tracking system fit each other; nothing here needs a link.

for check in checks(site, experiment): ...
"""

import math
from collections.abc import Iterator

from ivl import gamepad
from ivl.check import Check
from ivl.errors import ConfigError
from ivl.experiment import Experiment
from ivl.site.file import Fence, SiteFile
from ivl.startpoint import Point, path_m, start_point
from ivl.world import World

FENCE_MARGIN_M = 0.2
"""A hover strays by less; so far inside the fence are all places that the vehicle is sent to."""
HOVER_RESERVE = 1.15
"""Thrust over weight that a level vehicle needs to climb and to be held in a gust."""
FLIP_S = 0.1
"""From the trigger to the first touch; so far does a vehicle drift on under the board."""
_BISECTIONS = 40


def checks(site: SiteFile, experiment: Experiment | None = None) -> Iterator[Check]:
    """Make the checks of a site, and those of an experiment there if it is given (as `ivl.site.place.at` gives it)."""
    yield measured(site)
    yield tracking(site)
    yield stop(site)
    yield ceiling(site)
    yield places(site)
    if experiment is not None:
        world = experiment.make_world()
        yield latency(site, world)
        yield cue_plane(site, world)
        yield runway(site, world, experiment)
        yield board(site, world, experiment)
        yield thrust(site, world, experiment)


def measured(site: SiteFile) -> Check:
    """Nothing of what a tape or a flight can tell is a guess."""
    names = site.not_measured
    return Check(
        "measured", not names, f"not measured yet: {', '.join(names)}" if names else "everything", "everything",
        "measure each, write it down, and take its name out of not_measured",
    )  # fmt: skip


def tracking(site: SiteFile) -> Check:
    """A tracking system that sees a real vehicle."""
    found = "none: poses come from others" if site.mocap is None else f"{site.mocap.system}, body {site.mocap.body}"
    return Check(
        "tracking", not site.is_simulated, found, "a system that sees a real vehicle, or null",
        "write down the room's own tracking system under mocap; ivl mocap --list has examples",
    )  # fmt: skip


def stop(site: SiteFile) -> Check:
    """Said here, so that everybody knows before the first flight."""
    does = "abort, level-out, landing" if site.stop == "level_out" else "motors off: it falls, and is locked"
    pads = len(gamepad.found())
    who = f"any key in flight, ivl stop, or a button of a gamepad ({pads} found)"
    return Check("stop", True, f"{who}: {does}", "known to everybody in the room", "")


def ceiling(site: SiteFile) -> Check:
    """The board is inside the fence, or every approach ends there."""
    lo, hi = site.fence.z_m
    height_m = site.surface.height_m
    return Check(
        "ceiling inside fence", lo < 0.0 and height_m <= hi, f"board at {height_m:g} m, fence {lo:g} .. {hi:g} m",
        f"fence from below 0 m to {height_m:g} m or more", "correct fence.z_m, or surface.height_m",
    )  # fmt: skip


def places(site: SiteFile) -> Check:
    """Home, emergency landing and landing point are well inside the fence."""
    named = {"landing point": (0.0, 0.0), "home_m": site.home_m, "emergency_m": site.emergency_m}
    outside = [f"{name} ({x:g}, {y:g})" for name, (x, y) in named.items() if not _inside(site.fence, x, y)]
    return Check(
        "places inside fence", not outside, f"outside: {', '.join(outside)} m" if outside else "all",
        f"{FENCE_MARGIN_M:g} m inside fence.x_m and fence.y_m", "correct the place, or the fence",
    )  # fmt: skip


def latency(site: SiteFile, world: World) -> Check:
    """Measured here, or said to be assumed."""
    return _cue("latency", "cues.latency_s", site.cues.latency_s, world.params.values["sense.latency"], "s")


def cue_plane(site: SiteFile, world: World) -> Check:
    """Measured here, or said to be assumed."""
    value_m = world.params.values["world.sensed_gap_offset"]
    return _cue("cue plane", "cues.plane_above_m", site.cues.plane_above_m, value_m, "m")


def runway(site: SiteFile, world: World, experiment: Experiment) -> Check:
    """The path to the board fits between floor and fence."""
    needed = f"start at 0.3 m or higher, {FENCE_MARGIN_M:g} m inside the fence"
    remedy = "fly slower or steeper, or make the fence longer"
    try:
        start_W_m = start_point(world, experiment)
    except ConfigError as error:
        return Check("runway", False, str(error), needed, remedy)
    told = "path of {:.2f} m from ({:.2f}, {:.2f}, {:.2f}) m".format(path_m(world, experiment), *start_W_m)
    return Check("runway", _inside(site.fence, *start_W_m[:2]) and _high(site.fence, start_W_m), told, needed, remedy)


def board(site: SiteFile, world: World, experiment: Experiment) -> Check:
    """The board is where the feet may come down: a leg's reach around, and what an approach drifts on in its flip."""
    reach_m = float(world.derived()["reach_m"])
    along_m = reach_m + FLIP_S * experiment.speed_mps * math.cos(math.radians(experiment.angle_deg))
    surface = site.surface
    needed = {"before_m": along_m, "beyond_m": along_m, "left_m": reach_m, "right_m": reach_m}
    short = [f"{name} {getattr(surface, name):g} m" for name, least in needed.items() if getattr(surface, name) < least]
    return Check(
        "board", not short, f"too short: {', '.join(short)}" if short else "reaches far enough",
        f"{along_m:.2f} m along the approach, {reach_m:.2f} m across", "use a larger board, or move the landing point",
    )  # fmt: skip


def thrust(site: SiteFile, world: World, experiment: Experiment) -> Check:
    """With the weakest battery that may begin, the vehicle hovers with a reserve and gets to its speed on the path."""
    gravity_mps2 = world.params.values["world.gravity"]
    mass_kg = float(world.derived()["mass_total_kg"])
    still_N = thrust_N(world, site.battery.rest_V_min)
    angle_rad = math.radians(experiment.angle_deg)
    loss = world.params.values["rotor.inflow_loss"] * experiment.speed_mps * math.sin(angle_rad)
    accel_mps2 = _along(still_N * (1.0 - loss) / mass_kg, gravity_mps2, angle_rad)
    reached_mps = math.sqrt(2.0 * max(accel_mps2, 0.0) * path_m(world, experiment))
    ratio = still_N / (mass_kg * gravity_mps2)
    return Check(
        "thrust", ratio >= HOVER_RESERVE and reached_mps >= experiment.speed_mps,
        f"{ratio:.2f} of the weight, up to {reached_mps:.2f} m/s on the path ({site.battery.type}, "
        f"{site.battery.rest_V_min:g} V)",
        f"{HOVER_RESERVE:g} of the weight, {experiment.speed_mps:g} m/s",
        "raise battery.rest_V_min, fly slower, or take weight off",
    )  # fmt: skip


def thrust_N(world: World, open_circuit_V: float) -> float:
    """Thrust of all rotors at full duty, at rest in the air, that a battery of this voltage gives, N.

    Equations (2.6) to (2.8) of the model: the voltage falls with the thrust, and the thrust with the voltage.
    """
    values = world.params.values
    most_N = 4.0 * values["rotor.thrust_max"]
    if values["battery.voltage"] == 0.0:  # a supply that never sags
        return most_N
    low_N, high_N = 0.0, 4.0 * most_N
    for _ in range(_BISECTIONS):
        middle_N = 0.5 * (low_N + high_N)
        loaded_V = max(open_circuit_V - values["battery.sag"] * middle_N, 0.0)
        scale = max(1.0 + values["battery.speed_slope"] * (loaded_V / values["battery.rated_voltage"] - 1.0), 0.0)
        low_N, high_N = (middle_N, high_N) if most_N * scale**2 > middle_N else (low_N, middle_N)
    return low_N


def _along(force_mps2: float, gravity_mps2: float, angle_rad: float) -> float:
    """Largest acceleration along a path at an angle above the horizontal; negative: not even the weight is carried."""
    across_mps2 = gravity_mps2 * math.cos(angle_rad)
    if force_mps2 < across_mps2:
        return -1.0
    return math.sqrt(force_mps2**2 - across_mps2**2) - gravity_mps2 * math.sin(angle_rad)


def _inside(fence: Fence, x_m: float, y_m: float) -> bool:
    spans = ((x_m, fence.x_m), (y_m, fence.y_m))
    return all(lo + FENCE_MARGIN_M <= value <= hi - FENCE_MARGIN_M for value, (lo, hi) in spans)


def _high(fence: Fence, point_W_m: Point) -> bool:
    lo, hi = fence.z_m
    return lo + FENCE_MARGIN_M <= point_W_m[2] <= hi - FENCE_MARGIN_M


def _cue(name: str, field: str, said: float | None, used: float, unit: str) -> Check:
    """An assumption is allowed, and is said to be one."""
    found = f"{used:g} {unit}, measured here" if said is not None else f"{used:g} {unit}, ASSUMED from the vehicle file"
    return Check(name, True, found, "measured here, or said to be assumed", f"measure {field} with ivl flight identify")
