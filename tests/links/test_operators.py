"""The questions to the operator: each needs its word, at a terminal, typed after it was asked."""

import io
import itertools
import os
import pty
import random
import string
import subprocess
import sys
from collections.abc import Callable, Iterator

import pytest
from rich.console import Console

from ivl import forms
from ivl.links import operators
from ivl.links.forecast import Forecast
from ivl.links.operators import ConsoleOperator, OperatorStopped, Seen, Upcoming
from ivl.links.trouble import STATES, Cause, Instead, Vetoed, state_of
from ivl.links.truth import Resting

RESTING = Resting((0.0, 0.0, 2.0), (0.0, 0.0, -1.0))
NEXT = Upcoming(
    17, 160, forms.by_name("constant"), (4.2, 7.5), [(0.0, 7.0), (0.0, 9.5)], Forecast(64, 60, 3), (0.0, 0.0, 1.0),
    (0.5, -0.2),
)  # fmt: skip


def operator(*answers: str) -> tuple[ConsoleOperator, io.StringIO]:
    """One to whom these answers are typed, and what is shown; afterwards the terminal is closed."""
    told = io.StringIO()
    lines: Iterator[str] = iter(answers)

    def read() -> str:
        line = next(lines, None)
        if line is None:
            raise OperatorStopped("no more answers")
        return f"{line}\n"

    return ConsoleOperator(Console(file=told, width=300), countdown_s=0, read=read), told


WRONG = [
    "", " ", "y", "Y", "yes", "f", "fl", "fly", "FLY 17", "Fly 17", "fly17", "fly 16", "fly 18", "fly 1", "fly 7",
    "fly 170", "fly 17.", "fly 17 17", "ffly 17", "fly -17", "fly 017", "17", "arm", "go", "go on", "ok", "4", "clean",
    "changed", "discard", "fly\x0017", "fly 17\x1b[A",
]  # fmt: skip


def test_no_wrong_key_arms() -> None:
    assert len(WRONG) >= 30
    asked, told = operator(*WRONG)
    with pytest.raises(OperatorStopped, match="no more answers"):
        asked.place(NEXT)
    assert told.getvalue().count("not understood") == len(WRONG)
    assert "take-off" not in told.getvalue()


def test_no_random_line_arms() -> None:
    rng = random.Random(3)
    lines = ["".join(rng.choices("fly 17\tfly" + string.printable, k=rng.randrange(0, 9))) for _ in range(2000)]
    known = ("fly 17", "veto", "instead", "stop")
    lines = [line for line in lines if " ".join(line.split()) not in known and "\n" not in line]
    lines.append("stop")
    asked = ConsoleOperator(Console(quiet=True), countdown_s=0, read=iter(lines).__next__)
    with pytest.raises(OperatorStopped, match="stopped by the operator"):
        asked.place(NEXT)


def test_the_flight_is_shown_before_it_is_armed() -> None:
    asked, told = operator("  fly   17 ")
    asked.place(NEXT)
    text = told.getvalue()
    for part in (
        "rollout 17 of 160",
        "RREV_c 4.2 1/s, M_yd 7.5 N mm",
        "60 of 64 land",
        "3 of 64 strike",
        "(0.50, -0.20)",
    ):
        assert part in text, part
    asked, _ = operator("veto")
    with pytest.raises(Vetoed):
        asked.place(NEXT)


def test_take_off_is_counted_down_and_the_battery_is_named() -> None:
    told = io.StringIO()
    lines = iter(("fly 17", "changed"))
    asked = ConsoleOperator(Console(file=told, width=300), countdown_s=1, read=lambda: next(lines))
    asked.place(NEXT)
    asked.change_battery(3.42, 3.7)
    for part in ("hover at (0.00, 0.00, 1.00) m", "take-off in 1", "BATTERY: 3.42 V, needed 3.70 V"):
        assert part in told.getvalue(), part


@pytest.mark.parametrize(
    "question",
    [
        lambda asked: asked.place(NEXT),
        lambda asked: asked.change_battery(3.5, 3.7),
        lambda asked: asked.help(Cause.LOCKED),
        lambda asked: asked.confirm(Seen(4, False), RESTING, ""),
    ],
)
def test_stop_is_a_word_everywhere_and_return_is_none(question: Callable[[ConsoleOperator], object]) -> None:
    asked, told = operator("", "", "", "stop")
    with pytest.raises(OperatorStopped, match="stopped by the operator"):
        question(asked)
    assert told.getvalue().count("not understood") == 3


def test_another_policy_is_flown_instead_if_it_is_within_the_bounds() -> None:
    wrong = ["", "4", "4 5 6", "4,1 5", "4 x", "nan 5", "7.01 5", "4 -0.1", "inf inf", "fly 17"]
    asked, told = operator("instead", *wrong, "6.5  1.25")
    with pytest.raises(Instead) as raised:
        asked.place(NEXT)
    assert raised.value.theta == (6.5, 1.25)
    assert told.getvalue().count("not understood") == len(wrong)
    assert "take-off" not in told.getvalue()
    asked, _ = operator("instead", "stop")
    with pytest.raises(OperatorStopped):
        asked.place(NEXT)


def test_an_outcome_is_typed_and_not_taken_from_the_suggestion() -> None:
    legs, body = ("4", "3", "2", "1", "0"), ("touched", "clean")
    for n, touched in itertools.product(legs, body):
        asked, _ = operator("", "y", n, "y", touched)
        assert asked.confirm(Seen(4, False), RESTING, "") == Seen(int(n), touched == "touched")
    asked, _ = operator("discard")
    assert asked.confirm(Seen(4, False), RESTING, "").discard


@pytest.mark.parametrize("state", [state for state in STATES if state.asks], ids=lambda state: state.cause.value)
def test_each_state_asks_for_what_its_row_says(state: object) -> None:
    cause = state.cause  # type: ignore[attr-defined]
    asked, told = operator("go", "go on")
    asked.help(cause)
    assert f"{cause.upper()}: {state_of(cause).asks}, then" in told.getvalue()
    assert told.getvalue().count("not understood") == 1


def test_every_cause_is_a_row() -> None:
    assert [state.cause for state in STATES] == list(Cause)


def test_nobody_is_asked_who_is_no_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdin", io.StringIO("fly 17\nfly 17\n"))
    with pytest.raises(OperatorStopped, match="standard input is no terminal"):
        operators.read_line()


PROGRAM = """
import os
import sys
from ivl.links import operators
drop = operators.drop_typed
def drop_and_tell():
    drop()
    print("asked", flush=True)
operators.drop_typed = drop_and_tell
os.read(int(sys.argv[1]), 1)  # until something was typed
print(repr(operators.read_line()), flush=True)
"""


def test_what_was_typed_before_the_question_is_dropped() -> None:
    """At a terminal of its own: a line that lies there when the question appears is no answer to it."""
    master, slave = pty.openpty()
    wait, typed = os.pipe()
    program = [sys.executable, "-c", PROGRAM, str(wait)]
    with subprocess.Popen(program, stdin=slave, stdout=subprocess.PIPE, text=True, pass_fds=[wait]) as process:
        assert process.stdout is not None
        os.write(master, b"fly 17\nfly 17\n")
        os.write(typed, b".")
        assert process.stdout.readline() == "asked\n"
        os.write(master, b"veto\n")
        line = process.stdout.readline()
    for descriptor in (master, slave, wait, typed):
        os.close(descriptor)
    assert line == "'veto\\n'\n"
