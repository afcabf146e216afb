"""`ivl can-gateway`."""

import asyncio
import signal
from typing import Annotated, Any
from urllib.parse import urlsplit

import typer

from ivl.cli import console
from ivl.errors import ConfigError, LinkError

HELP = """Carry the link of a vehicle over a CAN bus: the end at the host, or the end at the vehicle.

This is for the bench, not for free flight. The end at the host looks like a vehicle on a UDP port to cflib, cfclient
and `--uri` of the other commands. The end at the vehicle talks to a software vehicle, or to a bench node that speaks
CRTP on UDP. Any interface of python-can works. Ctrl-C ends it. docs/CAN.md has frames, wiring and limits.

\b
Examples:
  ivl can-gateway --interface socketcan --channel can0 --listen 127.0.0.1:19851
      the end at the host, classic CAN; its bit rate is set by `ip link`
  ivl can-gateway --interface slcan --channel /dev/ttyACM0 --bitrate 1000000 --to udp://127.0.0.1:19850
      the end at the vehicle
  ivl can-gateway --interface udp_multicast --channel 239.74.163.2 --fd --to udp://127.0.0.1:19850
      without hardware: start both ends, and then `ivl learn ... --uri udp://127.0.0.1:19851`
  ivl can-gateway --node 3 --print-dbc > node3.dbc
      the frames that people look at, for candump and SavvyCAN
"""
_REPORT_S = 0.2
_FULL_S = 5.0
_NETWORKED = "udp_multicast"


def can_gateway(
    interface: Annotated[str | None, typer.Option(help="Interface of python-can: socketcan, slcan, pcan, ...")] = None,
    channel: Annotated[str | None, typer.Option(help="Channel of the interface: can0, /dev/ttyACM0, ...")] = None,
    bitrate: Annotated[int | None, typer.Option(help="Bit rate, 1/s.", min=10_000, max=1_000_000)] = None,
    data_bitrate: Annotated[
        int | None, typer.Option(help="Bit rate of the data in CAN FD frames, 1/s.", min=10_000, max=8_000_000)
    ] = None,
    fd: Annotated[bool, typer.Option("--fd", help="CAN FD: one frame for each packet.")] = False,
    bus_options: Annotated[
        list[str] | None, typer.Option("--bus-option", metavar="NAME=VALUE", help="Anything else for the interface.")
    ] = None,
    node: Annotated[int, typer.Option(help="Number of the vehicle on the bus.", min=0, max=15)] = 0,
    listen: Annotated[
        str | None, typer.Option(metavar="HOST:PORT", help="End at the host: where the vehicle appears.")
    ] = None,
    to: Annotated[
        str | None, typer.Option(metavar="udp://HOST:PORT", help="End at the vehicle: where it listens.")
    ] = None,
    allow_arming: Annotated[bool, typer.Option("--allow-arming", help="Let requests to arm the motors pass.")] = False,
    print_dbc: Annotated[bool, typer.Option("--print-dbc", help="Print ivl.dbc for this node and exit.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the counts as one JSON object at the end.")] = False,
) -> None:
    """Run one end of the link; HELP is the text that people see."""
    dbc, gateway = _modules()
    if print_dbc:
        print(dbc.database(node).as_dbc_string())
        return
    if (listen is None) == (to is None):
        raise ConfigError("exactly one of --listen (end at the host) and --to (end at the vehicle) is needed")
    if interface is None:
        raise ConfigError("--interface is needed, and for most interfaces --channel")
    options = gateway.Options(
        node, _address(listen, "--listen"), _address(to, "--to"), fd, allow_arming, interface == _NETWORKED
    )
    bus = _open_bus(interface, channel, bitrate, data_bitrate, fd, bus_options or [])
    try:
        end = gateway.make_gateway(bus, options)
        try:
            asyncio.run(_serve(end))
        except OSError as error:
            raise LinkError(f"{listen or to}: {error.strerror or error}") from error
        finally:
            if as_json:
                console.print_json(end.report())
    finally:
        bus.shutdown()


def _modules() -> tuple[Any, Any]:
    try:
        from ivl.can import dbc, gateway
    except ImportError as error:
        raise LinkError(f"the CAN link needs python-can and cantools: pip install 'ivl[link]' ({error})") from error
    return dbc, gateway


def _address(text: str | None, option: str) -> tuple[str, int] | None:
    if text is None:
        return None
    parts = urlsplit(text if "://" in text else f"udp://{text}")
    try:
        host, port = parts.hostname, parts.port
    except ValueError:
        host, port = None, None
    if parts.scheme != "udp" or not host or not port or parts.path not in ("", "/"):
        raise ConfigError(f"{option}: value {text!r} is no UDP port (expected HOST:PORT, such as 127.0.0.1:19850)")
    return host, port


def _open_bus(
    interface: str, channel: str | None, bitrate: int | None, data_bitrate: int | None, fd: bool, more: list[str]
) -> Any:
    import can

    settings: dict[str, Any] = {"bitrate": bitrate, "data_bitrate": data_bitrate, "fd": fd or None}
    if interface == _NETWORKED:
        settings["hop_limit"] = 0  # frames stay on this machine unless somebody says otherwise
    for text in more:
        name, equals, value = text.partition("=")
        if not equals or not name:
            raise ConfigError(f"--bus-option {text!r}: expected NAME=VALUE")
        settings[name] = int(value) if value.isdecimal() else value
    given = {name: value for name, value in settings.items() if value is not None}
    try:
        return can.Bus(interface=interface, channel=channel, ignore_config=True, **given)
    except (can.CanError, NotImplementedError, ValueError, TypeError, OSError) as error:
        raise LinkError(f"CAN interface {interface}, channel {channel}: {' '.join(str(error).split())}") from error


async def _serve(end: Any) -> None:
    loop = asyncio.get_running_loop()
    running = asyncio.ensure_future(end.run())
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, running.cancel)
    said, n_unsent, t_full_s = None, 0, float("-inf")
    while not running.done():
        await asyncio.wait({running}, timeout=_REPORT_S)
        report = end.report()
        if report["n_unsent"] > n_unsent and loop.time() - t_full_s >= _FULL_S:
            text = (
                f"the bus is full: {report['n_unsent'] - n_unsent} frames were not sent; log less, or give the "
                "interface a longer queue (SocketCAN: ip link set can0 txqueuelen 1000)"
            )
            n_unsent, t_full_s = report["n_unsent"], loop.time()
            console.err.print(f"node {end.options.node}: {text}", highlight=False, soft_wrap=True)
        if report["up"] != said and not running.done():
            said = report["up"]
            text = "link up" if said else f"link down, other end: {report['peer']}"
            console.err.print(f"node {end.options.node}: {text}")
    if not running.cancelled():
        running.result()
