"""Who may fly without a site file, and what a site must be like before a drone flies there."""

from pathlib import Path

from ivl.check import failures
from ivl.errors import ConfigError
from ivl.experiment import Experiment
from ivl.site import file as site_file
from ivl.site.checks import checks
from ivl.site.file import SiteFile

DRONE_SCHEMES = ("radio", "usb", "serial")
"""Links at whose other end there is no software vehicle."""
LINK_OF_SITE = "site"
"""What `--uri` says for the link of the site file."""
HOW = "write a site file with `ivl site new lab.yaml`, measure the room, and add --site lab.yaml"
OWN_CAMERAS = (
    "--mocap: a rehearsed day has cameras of its own: leave --mocap out, or fly a vehicle of `ivl sil` that is tracked "
    "in real time: add --uri udp://HOST:PORT"
)
_OF_THE_ROOM = ("measured", "tracking")
"""Checks that say nothing of a rehearsal, which flies in the numbers of the file as they are."""


def is_drone(uri: str) -> bool:
    """Whether this link leads to a vehicle that is no software vehicle."""
    return uri.partition("://")[0] in DRONE_SCHEMES


def for_flight(experiment: Experiment, uri: str, rehearse: bool = False) -> SiteFile | None:
    """The site file that a flight is flown with; None: a software vehicle in its simulator needs none.

    Raises:
        ConfigError: A drone or a rehearsal has none, or it is not fit to fly in.
    """
    if rehearse and is_drone(uri):
        raise ConfigError(f"--rehearse: {uri} leads to no software vehicle; leave --uri out, and one is started")
    if experiment.site is None:
        if rehearse:
            refuse_without_site(None)
        if is_drone(uri):
            raise ConfigError(f"--uri {uri}: a drone flies only in a room that is described: {HOW}")
        return None
    site = site_file.load(experiment.site)
    if rehearse or is_drone(uri):
        refuse_unfit(site, experiment, rehearse)
    return site


def refuse_without_site(site: SiteFile | None) -> SiteFile:
    """The site itself.

    Raises:
        ConfigError: There is none.
    """
    if site is None:
        raise ConfigError(f"--rehearse: a day is rehearsed in a room that is described: {HOW}")
    return site


def refuse_unfit(site: SiteFile, experiment: Experiment, rehearse: bool) -> None:
    """Refuse a site that does not suit its experiment; a drone's must be measured, and tracked by a real system.

    Raises:
        ConfigError: The checks that failed, in one line.
    """
    found = checks(site, experiment)
    told = failures(check for check in found if not (rehearse and check.name in _OF_THE_ROOM))
    if told:
        raise ConfigError(f"site {site.name}: not fit to fly: {told} (ivl site check shows all)")


def link_of(experiment: Experiment, uri: str | None, site_now: str | None = None) -> str | None:
    """A link as it was given; that of the site file where `site` stands for it.

    Args:
        experiment: What is flown.
        uri: The link as it was given.
        site_now: The site file as it is on a later day of a run, which may name another link, and nothing else.

    Raises:
        ConfigError: There is no site file, or the later one differs in more than its link.
    """
    if site_now is not None and uri != LINK_OF_SITE:
        raise ConfigError(f"--site {site_now}: a run that is resumed takes only its link from there: add --uri site")
    if uri != LINK_OF_SITE:
        return uri
    if experiment.site is None:
        raise ConfigError(f"--uri site: the experiment has no site: {HOW}")
    site = site_file.load(experiment.site)
    if site_now is None:
        return site.link
    now = site_file.load(site_now)
    for name in SiteFile.model_fields:
        if name != "link" and not _same(getattr(site, name), getattr(now, name)):
            raise ConfigError(
                f"--site {site_now}: {name}: value {getattr(now, name)!r} (allowed {getattr(site, name)!r}, as the run "
                "has it): only the link may be another one; begin a new run, with --from this one"
            )
    return now.link


def _same(a: object, b: object) -> bool:
    """Equal values, or names of files with the same content."""
    files = [Path(value) for value in (a, b) if isinstance(value, str) and Path(value).is_file()]
    return a == b or (len(files) == 2 and files[0].read_bytes() == files[1].read_bytes())
