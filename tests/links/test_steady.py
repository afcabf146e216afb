"""What is replaced in cflib is still there to be replaced, and what needs replacing still does."""

import inspect

import cflib.crazyflie
import pytest
from cflib.crtp.udpdriver import UdpDriver

from ivl.links.steady import SteadyCrazyflie, _first_line

REPLACED = ("send_packet", "_platform_info_fetched", "_param_toc_updated_cb", "_link_error_cb")


@pytest.mark.parametrize("name", REPLACED)
def test_replaced_method_exists_in_cflib_with_the_same_arguments(name: str) -> None:
    original = inspect.signature(getattr(cflib.crazyflie.Crazyflie, name))
    ours = inspect.signature(getattr(SteadyCrazyflie, name))
    assert list(ours.parameters) == list(original.parameters)


def test_udp_link_of_cflib_still_does_not_repeat() -> None:
    """If it did, the replacement could go."""
    assert UdpDriver().needs_resending is False


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("Couldn't load link driver: no dongle\n\nTraceback (most ...)\n  File x", "no dongle"),
        ("Error communicating with the Crazyflie\nException:refused", "Exception:refused"),
        ("UdpDriver: Could not send packet\nException: gone", "Exception: gone"),
        ("", "no reason given"),
    ],
)
def test_first_line_is_the_reason(text: str, wanted: str) -> None:
    assert _first_line(text) == wanted
