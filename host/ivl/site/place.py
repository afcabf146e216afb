"""An experiment as it is flown at a site: what the room sets of the world, and of the flight core's limits.

    there = at(experiment, site, "lab.yaml")

What the site says becomes overrides of the experiment with the site as their source, so that the simulator that judges
has the same room. Doing it again changes nothing.
"""

import math
from typing import TYPE_CHECKING

from ivl import model
from ivl.errors import ConfigError
from ivl.settings import Setting
from ivl.site.file import SiteFile

if TYPE_CHECKING:
    from ivl.experiment import Experiment

BATTERY = "battery.voltage"
"""Voltage at rest; a vehicle for which it is 0 has a supply that never sags."""


def settings(site: SiteFile) -> dict[str, float]:
    """World parameters that a site sets, in the units of the parameter table."""
    fence, battery, cues = site.fence, site.battery, site.cues
    values = {
        "world.ceiling_height": site.surface.height_m,
        "firmware.vbat_rest_min": battery.hover_V_min,
        "firmware.vbat_min": battery.load_V_min,
    }
    for axis, span in (("x", fence.x_m), ("y", fence.y_m), ("z", fence.z_m)):
        values |= {f"firmware.fence_{axis}_min": span[0], f"firmware.fence_{axis}_max": span[1]}
    measured = {"sense.latency": cues.latency_s, "world.sensed_gap_offset": cues.plane_above_m}
    return values | {name: value for name, value in measured.items() if value is not None}


def batteries(site: SiteFile) -> dict[str, float]:
    """World parameters of a day's batteries: at rest anywhere between just charged and too empty to begin.

    Mean and standard deviation of an even spread over that range.
    """
    full_V, least_V = site.battery.full_V, site.battery.rest_V_min
    return {BATTERY: 0.5 * (full_V + least_V), f"{BATTERY}_scatter": (full_V - least_V) / math.sqrt(12.0)}


def at(experiment: "Experiment", site: SiteFile, label: str) -> "Experiment":
    """The experiment with the site's vehicle and settings.

    Args:
        experiment: What is flown.
        site: Where.
        label: File of the site, which errors and overrides name.

    Raises:
        ConfigError: The experiment says of a parameter of the site something else, or a value is out of range.
    """
    source = f"site {site.name}"
    overrides = dict(experiment.overrides)
    for name, value in settings(site).items():
        said = overrides.get(name)
        if said is not None and said.value != value:
            raise ConfigError(
                f"{label}: {experiment.name} overrides {name} with {said.value:g} {said.unit} (allowed {value:g}, as "
                "the site says): leave the override out, or correct the site"
            )
        checked = _checked(name, value, label)
        overrides[name] = said or Setting(value=checked, unit=model.unit(name), source=source)
    return experiment.model_copy(update={"overrides": overrides, "vehicle": site.vehicle})


def _checked(name: str, value: float, label: str) -> float:
    try:
        return model.check_override(name, value)
    except ConfigError as error:
        raise ConfigError(f"{label}: {error}") from error
