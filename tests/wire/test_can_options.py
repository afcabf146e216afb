"""Options of the gateway's program."""

import re

import cantools
import pytest

from ivl import cli


@pytest.mark.parametrize(
    ("arguments", "code", "text"),
    [
        (["--interface", "virtual"], 2, "exactly one of --listen .* and --to"),
        (["--to", "udp://127.0.0.1:19850"], 2, "--interface is needed"),
        (["--interface", "virtual", "--to", "radio://0"], 2, "--to: value 'radio://0' is no UDP port"),
        (["--interface", "virtual", "--listen", "127.0.0.1:99999"], 2, "--listen: value .* is no UDP port"),
        (["--interface", "virtual", "--listen", ":1", "--bus-option", "x"], 2, "is no UDP port"),
        (
            ["--interface", "virtual", "--listen", "a:1", "--bus-option", "x"],
            2,
            "--bus-option 'x': expected NAME",
        ),
        (["--interface", "nosuch", "--listen", "127.0.0.1:1"], 1, "CAN interface nosuch"),
        (
            ["--interface", "socketcan", "--channel", "ivlnone0", "--listen", "a:1"],
            1,
            "CAN interface socketcan",
        ),
    ],
)
def test_wrong_options_are_one_line(
    arguments: list[str], code: int, text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.run(["can-gateway", *arguments]) == code
    error = capsys.readouterr().err
    assert re.search(text, error)
    assert error.count("\n") == 1


def test_print_dbc_is_a_dbc(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["can-gateway", "--print-dbc", "--node", "3"]) == 0
    database = cantools.database.load_string(capsys.readouterr().out)
    assert database.get_message_by_name("HEARTBEAT_HOST").frame_id == 0x703
    assert database.get_message_by_name("POLICY_PARAM").get_signal_by_name("value").is_float
