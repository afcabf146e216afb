"""`ivl doctor`."""

from typing import Annotated

import typer

from ivl import experiment
from ivl.cli import console, site_options
from ivl.errors import ConfigError, LinkError
from ivl.site import checks, require
from ivl.site import file as site_file

HELP = """Check a vehicle before it flies: what was found, what is needed, what to do.

The vehicle stays on the ground. With EXPERIMENT, its policy bounds and the configuration in force are checked too; with
--site the room: its file, and of a drone whether the tracking system sees it at home.

\b
Examples:
  ivl doctor --uri radio://0/80/2M/E7E7E7E7E7
      a table of PASS and FAIL; exit code 1 if anything fails
  ivl doctor experiments/paper_vertical.yaml --uri udp://127.0.0.1:19850 --send
      put the experiment's configuration in force first
  ivl doctor experiments/paper_flight.yaml --site lab.yaml --uri site
      the room as well: what is not measured, runway, board, thrust left; docs/SITE.md
  ivl doctor --uri udp://127.0.0.1:19850 --json
      for a script
"""


def doctor(
    uri: Annotated[
        str, typer.Option(help="Link of the vehicle: radio://, usb://, udp://, tcp:// or serial://; or site.")
    ],
    path: Annotated[str | None, typer.Argument(metavar="[EXPERIMENT]", help="YAML file of the experiment.")] = None,
    site: site_options.Site = None,
    send: Annotated[bool, typer.Option("--send", help="Put the experiment's configuration in force first.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> int:
    """Check a vehicle; HELP is the text that people see."""
    try:
        from ivl.links import connection, preflight, sil, tables, tracking
        from ivl.links.vehicle import Vehicle
    except ImportError as error:
        raise LinkError(f"{uri}: a link needs cflib: pip install 'ivl[link]' ({error})") from error
    room = site_file.load(site) if site else None
    chosen = experiment.load(path, site=site) if path else None
    uri = room.link if room is not None and uri == require.LINK_OF_SITE else uri
    if send and chosen is not None and chosen.site is None and require.is_drone(uri):
        raise ConfigError(f"--send: a drone gets the configuration of a room that is described: {require.HOW}")
    connection.check_uri(uri)
    with tables.Session(uri) as session:
        vehicle = Vehicle(session)
        if send and chosen is not None:
            vehicle.configure(chosen.make_world())
        least_V = room.battery.rest_V_min if room else preflight.BATTERY_V_MIN
        found = [*(checks.checks(room, chosen) if room else ())]
        if room is not None and not sil.is_sil(session):
            found += tracking.site_checks(vehicle, room)
        found += preflight.checks(vehicle, chosen, least_V)
    fit = all(check.ok for check in found)
    if as_json:
        console.print_json({"uri": uri, "fit": fit, "checks": [check.as_dict() for check in found]})
    else:
        console.print_checks(found)
    return 0 if fit else 1
