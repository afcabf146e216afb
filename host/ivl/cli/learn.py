"""`ivl learn`."""

import shlex
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ivl import experiment, links, margin, run
from ivl.cli import console, live_options, policy_options, site_options
from ivl.errors import ConfigError, IvlError
from ivl.experiment import Experiment
from ivl.links.options import Options
from ivl.policy import use
from ivl.site import require

if TYPE_CHECKING:
    from ivl.links.operators import Operator
    from ivl.live.board import Board
    from ivl.rehearsal.script import Script

HELP = """Learn to land: run an EXPERIMENT and judge what it learned.

EXPERIMENT is a YAML file; a name such as experiments/paper_vertical.yaml is also found inside the package.
A run folder keeps everything: resolved config, every rollout (run.sqlite), result.json and pictures.

\b
Examples:
  ivl learn experiments/paper_vertical.yaml
      the paper's vertical landing
  ivl learn experiments/paper_vertical.yaml --learner ephe
      another learner (see: ivl list learners)
  ivl learn experiments/paper_flight.yaml
      the paper's flown experiment, beginning with simulated vehicles: the first flights land
  ivl learn experiments/paper_flight.yaml --learner bo --set n_rollouts=8 --set budget=160
      the same by a learner that begins with nothing
  ivl learn experiments/transfer.yaml --trials 60 --json
      how soon sixty vehicles are learned that were never simulated exactly, and with how many failures
  ivl learn experiments/paper_vertical.yaml --set gear_set=table1 --set sense.latency=0.02
      another landing gear, slower sensing
  ivl learn experiments/paper_vertical.yaml --trials 100 --json
      how often and how fast, over 100 seeds, for a script
  ivl learn experiments/paper_vertical.yaml --uri pil://
      every tick decided by an emulated STM32
  ivl learn experiments/paper_vertical.yaml --uri udp://127.0.0.1:19850
      the whole stack, over the protocol of the drone: a software vehicle, started with
      ivl sil --experiment experiments/paper_vertical.yaml
  ivl learn experiments/paper_flight.yaml --site lab.yaml --rehearse
      a day in the room of lab.yaml (ivl site new), with a software vehicle as if it were a drone
  ivl learn experiments/paper_flight.yaml --site lab.yaml --rehearse --live
      the same, shown in a browser, with a button that stops the vehicle; see docs/LIVE.md
  ivl learn experiments/paper_flight.yaml --site lab.yaml --uri site
      the drone there; see docs/PROCEDURE.md and docs/SITE.md first
  ivl learn experiments/paper_vertical.yaml --policy g.yaml
      the search begins at the numbers of a policy for every approach
  ivl learn experiments/paper_flight.yaml --from runs/monday --from runs/tuesday
      the learner first gets the flights of earlier runs of the same task
  ivl learn --resume --out runs/mine
      go on after Ctrl-C, kill -9 or power loss
"""


_PORT_USUAL = "19850"


def learn(
    path: Annotated[str | None, typer.Argument(metavar="EXPERIMENT", help="YAML file of the experiment.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of learner and world.", min=0)] = None,
    trials: Annotated[
        int | None, typer.Option(help="Run this many seeds together: seed, seed + 1, ...", min=1, max=100_000)
    ] = None,
    learner: Annotated[str | None, typer.Option(help="Learner by name; see `ivl list learners`.")] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="A.B=C", help="Change a field of the experiment or a parameter of the world."),
    ] = None,
    policy_file: Annotated[
        Path | None, typer.Option("--policy", metavar="FILE", help="Begin the search with the numbers of a policy.")
    ] = None,
    earlier: Annotated[
        list[Path] | None,
        typer.Option("--from", metavar="RUN", help="Tell the learner first what an earlier run flew; may be repeated."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Run folder; default: a new one under runs/.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue a run that was cut off.")] = False,
    uri: Annotated[
        str | None,
        typer.Option(help="Where to fly: a vehicle's link, site (that of --site), or pil://; default: simulator."),
    ] = None,
    site: site_options.Site = None,
    rehearse: Annotated[
        bool, typer.Option("--rehearse", help="Fly a software vehicle as a drone; without --uri it is started.")
    ] = False,
    mocap: Annotated[
        str | None, typer.Option(metavar="CONFIG", help="Track the vehicle; file or name, see `ivl mocap --list`.")
    ] = None,
    script: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="What goes wrong on a rehearsed day: a file, default, or calm."),
    ] = None,
    answers: Annotated[
        str | None,
        typer.Option(metavar="FILE", help="Answers of a rehearsal's operator, one a line; or script: it answers."),
    ] = None,
    other_world: Annotated[
        bool, typer.Option("--other-world", help="Also fly a software vehicle that simulates another world.")
    ] = False,
    threads: Annotated[int | None, typer.Option(help="Worker threads; default: all processors.", min=1)] = None,
    live: live_options.Live = False,
    live_at: live_options.LiveAt = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object; progress goes to stderr.")] = False,
) -> None:
    """Learn to land; HELP is the text that people see."""
    chosen, n_trials = _choose(path, seed, trials, learner, settings or [], policy_file, out, resume, site)
    uri = require.link_of(chosen, uri, site if path is None else None) or (
        f"{links.REHEARSAL_SCHEME}://" if rehearse else None
    )
    if uri is not None:
        require.for_flight(chosen, uri, rehearse)
    folder = out or run.default_folder(chosen, n_trials, resume)
    hooks = run.Hooks(_announce, partial(console.print_episode, form=chosen.policy.shape), _stage, _bank, _drone, _note)
    with live_options.shown(chosen, folder, uri, live, live_at) as board:
        flight = Options(
            mocap=site_options.tracker(chosen, uri, mocap, rehearse),
            rehearse=rehearse,
            operator=_operator(answers, rehearse, board if links.is_vehicle(uri) else None),
            script=_script(script, uri),
            answered_by_script=_answers_itself(answers, rehearse, uri),
            other_world=other_world,
            start_hint=_start_hint(path or str(folder / "config.yaml"), _said(settings, site), uri or ""),
            say=console.say,
            observer=live_options.observer(board),
        )
        hooks = live_options.told(hooks, board)
        try:
            result = run.run(chosen, folder, n_trials, resume, threads, hooks, uri, flight, earlier or [])
        except KeyboardInterrupt:
            words = ["ivl", "learn", "--resume", "--out", str(folder)]
            words += ["--uri", uri] if uri and not uri.startswith(links.REHEARSAL_SCHEME) else []
            words += ["--mocap", mocap] if mocap else []
            words += [word for word, said in (("--rehearse", rehearse), ("--other-world", other_world)) if said]
            words += ["--script", script] if script else []
            words += ["--answers", answers] if answers else []
            console.say(f"interrupted; continue with: {shlex.join(words)}")
            raise
    pictures, failure = _draw(result) if n_trials is None else ([], None)
    if as_json:
        console.print_json(result.summary)
    else:
        _report(result, pictures)
    if failure:
        raise failure


_BY_SCRIPT = "script"
"""What `--answers` says for a rehearsal whose script answers."""


def _script(name: str | None, uri: str | None) -> "Script | None":
    """What goes wrong on a rehearsed day; None: it is none with a vehicle of its own.

    Raises:
        ConfigError: There is no such script, or nothing that it could happen to.
    """
    if not _is_own(uri):
        if name is not None:
            raise ConfigError(f"--script {name}: a script is for a rehearsal (--rehearse) without --uri")
        return None
    from ivl.rehearsal import script as scripts  # its modules load much of the links

    return scripts.load(name or scripts.DEFAULT)


def _is_own(uri: str | None) -> bool:
    """Whether a rehearsal starts its software vehicle itself."""
    return uri is not None and uri.startswith(links.REHEARSAL_SCHEME)


def _answers_itself(answers: str | None, rehearse: bool, uri: str | None) -> bool:
    """Whether the script answers, and not a person.

    Raises:
        ConfigError: There is no script that could.
    """
    if answers != _BY_SCRIPT:
        return False
    if not (rehearse and _is_own(uri)):
        raise ConfigError("--answers script: only a rehearsal (--rehearse) without --uri has a script that answers")
    return True


def _operator(answers: str | None, rehearse: bool, board: "Board | None") -> "Operator | None":
    """The operator at the terminal, or of a rehearsal whose answers are in a file; None: nobody special.

    Args:
        answers: The file.
        rehearse: Whether it is a rehearsal.
        board: Shows what is asked; None: nobody does.

    Raises:
        ConfigError: It is no rehearsal, or the file cannot be read.
    """
    if answers == _BY_SCRIPT or (answers is None and board is None):
        return None
    if answers is not None and not rehearse:
        raise ConfigError(f"--answers {answers}: only a rehearsal (--rehearse) is answered from a file")
    from ivl.links import operators  # its modules load cflib

    read = operators.read_line if answers is None else operators.answers_of(Path(answers))
    countdown_s = operators.COUNTDOWN_S if answers is None else 0
    return operators.ConsoleOperator(console.err, countdown_s, read if board is None else board.reader(read))


def _said(settings: list[str] | None, site: str | None) -> list[str]:
    """What was set on the command line, as `--set` says it."""
    return [*(settings or []), *([f"site={site}"] if site else [])]


def _start_hint(path: str, settings: list[str], uri: str) -> str:
    """Command that starts a software vehicle in the experiment's world."""
    words = ["ivl", "sil", "--experiment", path, *(word for text in settings for word in ("--set", text))]
    port = uri.rpartition(":")[2]
    return shlex.join([*words, "--port", port] if uri.startswith("udp://") and port != _PORT_USUAL else words)


def _choose(
    path: str | None, seed: int | None, trials: int | None, learner: str | None, settings: list[str],
    policy_file: Path | None, out: Path | None, resume: bool, site: str | None,
) -> tuple[Experiment, int | None]:  # fmt: skip
    """The experiment of the arguments, or the one that the folder to resume holds."""
    if path is not None:
        learned = policy_options.load(policy_file)
        change = use.as_start(learned) if learned is not None else None
        return experiment.load(path, settings, change, seed=seed, learner=learner, site=site), trials
    if not (resume and out):
        raise ConfigError(
            "EXPERIMENT is missing (only `--resume --out FOLDER` goes without); see: ivl list experiments"
        )
    if settings or learner or policy_file or seed is not None or trials is not None:
        raise ConfigError(
            "--resume without EXPERIMENT takes all from the run folder: "
            "leave out --set, --learner, --policy, --seed and --trials"
        )
    return run.read_config(out)


def _announce(folder: Path) -> None:
    console.err.print(f"run folder: {folder}")


def _stage(stage: int, n_stages: int) -> None:
    console.err.print(f"judging: best possible policy, stage {stage + 1} of {n_stages}")


def _drone(trial: int, n_trials: int) -> None:
    console.err.print(f"judging: best possible policy of vehicle {trial + 1} of {n_trials}")


def _note(text: str) -> None:
    console.err.print(f"note: {text}")


def _bank(done: int, n: int) -> None:
    if done == n or done % max(n // 10, 1) == 0:
        console.err.print(f"simulated vehicles: {done} of {n}")


def _draw(result: run.RunResult) -> tuple[list[Path], IvlError | None]:
    """Pictures of a single run, and why they are not all there; the result is told before that is."""
    pictures: list[Path] = []
    try:
        from ivl.plots import belief, convergence, strobe  # matplotlib takes a second to load

        pictures += convergence.draw_run(result)
        pictures += belief.draw_run(result)
        pictures += strobe.draw_last_landing(result)
    except Exception as error:  # noqa: BLE001 - whatever a picture raises, it is reported after the result
        what = str(error) if isinstance(error, IvlError) else f"{type(error).__name__}: {error}"
        return pictures, IvlError(f"the run is complete in {result.folder}, but a picture is missing: {what}")
    return pictures, None


def _report(result: run.RunResult, pictures: list[Path]) -> None:
    summary, best = result.summary, result.best
    if "flights_to_solved" in summary:
        lines = _lines_of_drones(summary)
    else:
        lines = _lines_of_trials(summary) if "trials" in summary else _lines_of_one(result)
        best_text = (
            f"{console.percent(best.rate_four_leg)} at {result.experiment.policy.shape.describe(best.theta)} "
            f"({best.search})"
        )
        lines.append(("best possible policy", best_text))
    if summary["discarded"]:
        lines.append(("discarded rollouts (not learned from)", str(summary["discarded"])))
    lines.extend(("note", text) for text in summary["warnings"])
    lines.append(("run folder", str(result.folder)))
    lines.extend(("picture", str(picture)) for picture in pictures)
    for name, text in lines:
        console.out.print(f"{name:36s} {text}")


def _lines_of_one(result: run.RunResult) -> list[tuple[str, str]]:
    summary, experiment = result.summary, result.experiment
    found = zip(experiment.policy.shape.params, summary["mu"], summary["sigma"], strict=True)
    reached = summary["rollouts_to_convergence"]
    flown = summary.get("flown")
    by = " (judged by the simulator)" if flown else ""
    return [
        *([] if flown is None else _lines_of_flown(flown)),
        ("solved", (f"yes, after {reached} rollouts" if summary["solved"] else "no") + by),
        *((p.symbol, f"{mu:.2f} ± {sigma:.2f} {p.unit}") for p, mu, sigma in found),
        ("landing rate, last three episodes", _rates(summary["landing_rate_four_leg"], summary["landing_rate_clean"])),
        (
            "of the recommended policy" + (", simulated" if flown else ""),
            _rates(summary["recommended_rate_four_leg"], summary["recommended_rate_clean"]),
        ),
        *margin.lines(summary["margin"], result.best, experiment),
        *([] if summary["model_fits"] is None else [("model", console.MODEL_FITS[summary["model_fits"]])]),
        ("failed landings until convergence", str(summary["failed_landings"])),
        ("failed landings in all", f"{summary['failed_landings_total']} of {summary['rollouts']} rollouts"),
    ]


def _lines_of_flown(flown: dict[str, Any]) -> list[tuple[str, str]]:
    """What the vehicle has flown, before anything that is simulated."""
    interval = f"95 %: {console.percent(flown['rate_lo'])} .. {console.percent(flown['rate_hi'])}"
    lines = [
        ("flown: landed on four legs", f"{flown['landed']} of {flown['landings']} ({console.percent(flown['rate'])}, "
                                       f"{interval}); simulated, the same policies: "
                                       f"{console.percent(flown['simulated_rate'])}"),
    ]  # fmt: skip
    if flown["judged_battery_V"] is not None:
        lines.append(
            ("battery of the judging simulator", f"{flown['judged_battery_V']:.2f} V at rest, as in the last flight")
        )
    if flown["pitch_rms_deg_median"] is not None:
        text = f"pitch {flown['pitch_rms_deg_median']:.1f} deg rms, median of the flips"
        lines.append(("recorded against simulated", text))
    return lines


def _lines_of_trials(summary: dict[str, Any]) -> list[tuple[str, str]]:
    reached, failed = summary["rollouts_to_convergence"], summary["failed_landings"]
    median, p90 = console.number(reached["median"], 0), console.number(reached["p90"], 0)
    return [
        ("solved", f"{summary['solved']} of {summary['trials']} trials"),
        ("rollouts to convergence", f"median {median}, 90 % within {p90}"),
        ("failed landings until convergence", f"median {console.number(failed['median'], 0)}"),
        ("stuck", f"{summary['stuck_trials']} trials"),
        ("recommended policies, mean", _rates(summary["landing_rate_four_leg"], summary["landing_rate_clean"])),
    ]


def _lines_of_drones(summary: dict[str, Any]) -> list[tuple[str, str]]:
    reached, failed, fits = summary["flights_to_solved"], summary["failed_landings"], summary["model_fits_trials"]
    beyond, best, room = summary["failed_landings_beyond_best"], summary["best_rate_four_leg"], summary["margin_rate"]
    lines = [
        ("solved", f"{summary['solved']} of {summary['trials']} vehicles"),
        ("flights to solved", f"median {console.number(reached['median'], 0)}, 90 % within "
                              f"{console.number(reached['p90'], 0)}"),
        ("failed landings in all flights", f"mean {console.number(failed['mean'], 1)}, 90 % within "
                                           f"{console.number(failed['p90'], 0)}"),
        ("beyond those of the best policies", f"mean {console.number(beyond['mean'], 1)}"),
        ("recommended policies, mean", _rates(summary["landing_rate_four_leg"], summary["landing_rate_clean"])),
        ("best possible policies", f"mean {console.percent(best['mean'])}, lowest {console.percent(best['lowest'])}"),
    ]  # fmt: skip
    if room is not None:
        share = console.percent(room.get("share_of_largest"))
        lines.append(
            ("margin rate of the recommendations", f"mean {console.percent(room['mean'])}, {share} of the largest")
        )
    if fits is not None:
        lines.append(("model fits", f"{fits['yes']} of {fits['yes'] + fits['no']} vehicles"))
    return lines


def _rates(four: float | None, spotless: float | None) -> str:
    return f"{console.percent(four)} on four legs, {console.percent(spotless)} clean"
