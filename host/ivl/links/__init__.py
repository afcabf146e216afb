"""Ways to fly that are not the simulator in this process; each is chosen by the scheme of a URI.

source = open_source("udp://127.0.0.1:19850", experiment)
"""

from dataclasses import replace

from ivl.errors import ConfigError, LinkError
from ivl.experiment import Experiment
from ivl.links import pil
from ivl.links.options import Options
from ivl.source import RolloutSource

VEHICLE_SCHEMES = ("udp", "radio", "usb", "tcp", "serial")
"""Links to a vehicle, a real or a software one."""
REHEARSAL_SCHEME = "rehearsal"
"""A software vehicle of its own, flown as a drone."""


def is_vehicle(uri: str | None) -> bool:
    """Whether a vehicle is flown there, a real or a software one; None: the simulator in this process."""
    return uri is not None and uri.partition("://")[0] in (*VEHICLE_SCHEMES, REHEARSAL_SCHEME)


def open_source(
    uri: str,
    experiment: Experiment,
    threads: int | None = None,
    options: Options | None = None,
    record: bool = False,
) -> RolloutSource:
    """The source that a URI names.

    Args:
        uri: pil://, rehearsal://, or a link to a vehicle.
        experiment: What is flown.
        threads: Worker threads; for pil://.
        options: How a vehicle is flown.
        record: Give what each flip recorded, too (`ivl.belief.recording`).

    Raises:
        ConfigError: No such scheme, or the rest of the URI makes no sense for it.
        RolloutError: The other end cannot be started, or must not fly.
        LinkError: The other end cannot be reached.
    """
    scheme, separator, _ = uri.partition("://")
    if separator and scheme == "pil":
        return pil.PilSource(uri, experiment, threads, record)
    if not separator or scheme not in (*VEHICLE_SCHEMES, REHEARSAL_SCHEME):
        allowed = ", ".join(f"{name}://" for name in ("pil", *VEHICLE_SCHEMES, REHEARSAL_SCHEME))
        raise ConfigError(f"uri: value {uri!r} is unknown (allowed {allowed})")
    try:
        from ivl.links import crazyflie, rehearsal  # cflib takes most of a second to load
    except ImportError as error:
        raise LinkError(f"{uri}: a link needs cflib: pip install 'ivl[link]' ({error})") from error
    options = options or Options()
    kept = replace(options, keep_recordings=record or options.keep_recordings)
    if scheme == REHEARSAL_SCHEME:
        return rehearsal.RehearsalSource(experiment, kept)
    return crazyflie.CrazyflieSource(uri, experiment, kept)
