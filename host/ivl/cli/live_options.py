"""`--live`: a view of the run beside it, told by the run's hooks and by what the terminal says."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ivl import links
from ivl.cli import console
from ivl.errors import IvlError
from ivl.experiment import Experiment
from ivl.learning.loop import Progress
from ivl.links.observer import NOBODY, Observer
from ivl.run import Hooks

if TYPE_CHECKING:
    from ivl.live.board import Board

Live = Annotated[bool, typer.Option("--live", help="Show the run in a browser while it goes on.")]
LiveAt = Annotated[
    str | None,
    typer.Option(metavar="HOST:PORT", help="Where --live shows it; default 127.0.0.1:8764. For Foxglove: next port."),
]


@contextmanager
def shown(chosen: Experiment, folder: Path, uri: str | None, live: bool, at: str | None) -> Iterator["Board | None"]:
    """Show a run as long as this lasts, if it is wanted; the board is what to tell.

    Raises:
        ConfigError: The address is none, or not free.
        IvlError: A package is missing.
    """
    if not live and at is None:
        yield None
        return
    try:
        from ivl.live import view
    except ModuleNotFoundError as error:
        raise IvlError(f"--live: {error.name} is not installed: pip install 'ivl[live]'") from error
    where = view.address(at or view.DEFAULT_AT)
    with ExitStack() as stack:
        opened = stack.enter_context(view.View(chosen, folder, where, not links.is_vehicle(uri), console.say))
        stack.enter_context(console.overheard(opened.board.hear))  # from here on: its address has the token
        yield opened.board


def observer(board: "Board | None") -> Observer:
    """Who looks on while a vehicle flies."""
    return NOBODY if board is None else board


def told(hooks: Hooks, board: "Board | None") -> Hooks:
    """The hooks of a run, which tell the board too."""
    if board is None:
        return hooks

    def on_bank(done: int, n: int) -> None:
        board.simulates(done, n)
        if hooks.on_bank:
            hooks.on_bank(done, n)

    def on_episode(progress: Progress) -> None:
        board.learns(progress.episode, progress.n_episodes)
        if hooks.on_episode:
            hooks.on_episode(progress)

    def judging(before: Callable[[int, int], None] | None) -> Callable[[int, int], None]:
        def on_judging(done: int, n: int) -> None:
            board.judges()
            if before:
                before(done, n)

        return on_judging

    return replace(
        hooks,
        on_bank=on_bank,
        on_episode=on_episode,
        on_stage=judging(hooks.on_stage),
        on_drone=judging(hooks.on_drone),
    )
