"""`ivl policy`: policies for every approach, one module a subcommand."""

import typer

from ivl.cli.policy import adapt, assess, learn, report, show

HELP = """Policies for every approach: learn one, look at it, judge it on fresh approaches.

\b
Examples:
  ivl policy learn experiments/general.yaml --out g.yaml
      from a map of thresholds, by direct search over random approaches, with go / no-go
  ivl policy show g.yaml
      its numbers, where they come from, and its threshold over the velocities
  ivl policy show g.yaml --plot pictures
      its surface, its landing rates beside those of other policies, approaches in the flow space, go / no-go
  ivl policy report g.yaml --out page.html
      all of that on one page, with flights to replay
  ivl policy assess g.yaml --json
      landing rates over fresh approaches, and what go / no-go is worth
  ivl policy adapt g.yaml --vehicles 10
      vehicles that differ from what it was learned on: what eight recorded flights of each are worth
  ivl rollout --policy g.yaml --speed 1.2 --angle 35 --plot p.png
      one landing with it; also ivl fly, ivl learn, ivl sweep and ivl sil take --policy
"""

app = typer.Typer(help=HELP, rich_markup_mode=None, no_args_is_help=True)
app.command("learn", help=learn.HELP, short_help="Learn a policy for every approach.")(learn.learn)
app.command("assess", help=assess.HELP, short_help="Judge a policy on fresh approaches.")(assess.assess)
app.command("adapt", help=adapt.HELP, short_help="Adapt a policy to vehicles that differ.")(adapt.adapt)
app.command("show", help=show.HELP, short_help="Show what a policy file holds.")(show.show)
app.command("report", help=report.HELP, short_help="Write the page of a policy.")(report.report)
