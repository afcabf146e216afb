"""`ivl policy report`."""

import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from ivl.cli import console, policy_options
from ivl.cli.policy import survey_options
from ivl.errors import ConfigError, IvlError
from ivl.policy import assess, file
from ivl.policy.shape import General
from ivl.policy.survey import survey

HELP = """Write the page of a policy: one HTML file with its numbers, pictures, and flights to replay.

The numbers are those of `ivl policy assess` with as many approaches; the pictures are those of `ivl policy show --plot`
with a folder; replayed are a landing and an approach that the policy calls off. All is flown for the page, on what the
policy was learned on.

\b
Examples:
  ivl policy report g.yaml --out page.html
      about 18 000 flights
  ivl policy report g.yaml --out page.html --approaches 200 --open
      fewer flights, wider intervals; look at it at once
  ivl policy report g.yaml --out page.html --rrev 4.8 --moment 8
      compare with this policy of the paper's form, in place of the best of a grid
"""


def report(
    path: Annotated[Path, typer.Argument(metavar="FILE", help="Policy file.")],
    out: Annotated[Path, typer.Option(help="HTML file to write.")],
    approaches: survey_options.Approaches = None,
    seed: survey_options.Seed = 0,
    rrev: policy_options.Rrev = None,
    moment: policy_options.Moment = None,
    threads: survey_options.Threads = None,
    open_: Annotated[bool, typer.Option("--open", help="Open the page in the web browser.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Write the page of a policy; HELP is the text that people see."""
    try:
        from ivl import report as reports  # plotly takes a second to load
    except ModuleNotFoundError as error:
        raise IvlError(f"{error.name} is not installed: pip install 'ivl[report]'") from error
    policy = file.load(path)
    General(policy.form)
    if not out.parent.is_dir():
        raise ConfigError(f"--out {out}: there is no folder {out.parent}")
    constant, n = survey_options.constant_of(rrev, moment), approaches or survey_options.N_APPROACHES
    with console.err.status("flying"):
        found = survey(policy, n, seed, constant, threads=threads)
        judged = assess.assess(policy, None, n, seed, threads)
        made = reports.write_policy(policy, path.name, found, judged, out)
    if as_json:
        console.print_json({"path": str(made.path), "size_bytes": made.size_bytes, "landings": made.n_landings})
    else:
        console.out.print(
            f"{made.path}: {made.size_bytes / 1e6:.1f} MB, {made.n_landings} flights to replay",
            highlight=False,
            soft_wrap=True,
        )
    if made.n_different:
        raise IvlError(f"{made.path}: {made.n_different} flights came out otherwise when they were flown again")
    if open_ and not webbrowser.open(made.path.resolve().as_uri()):
        raise IvlError(f"{made.path}: no web browser was found to open it with")
