"""From an experiment to a policy file: map, fit, search, choice, go / no-go.

policy = learn(general.load(["experiments/general.yaml"]))
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ivl.errors import ConfigError
from ivl.outcome import Outcomes, clean, four_leg
from ivl.policy import file, go, search
from ivl.policy.file import PolicyFile, Score, Training, WithGo
from ivl.policy.flying import Place, fly, objective
from ivl.policy.general import GeneralExperiment
from ivl.policy.polish import polish
from ivl.policy.region import Approaches, Region, Series
from ivl.policy.shape import FloatArray, General
from ivl.policy.start import best_of, fit, fly_map, moment_most_Nmm
from ivl.seeds import Purpose

_DIGITS = 7  # of a number in single precision, which is what a vehicle keeps
_N_CHECKPOINTS = 5
_TIMINGS_NORM = (0.5, 1.0)
"""Parts of the map's error of the trigger's instant, over which it is smoothed when policies are looked up in it."""


@dataclass(frozen=True)
class Progress:
    """Where learning stands.

    Attributes:
        stage: What is done now, in words.
        done: Part of this stage that is done, 0 .. 1.
        objective: Mean objective of the last iteration's candidates; NaN before there is one.
        n_flights: Flights so far.
    """

    stage: str
    done: float
    objective: float
    n_flights: int


@dataclass
class _State:
    """What is known so far, and kept if somebody interrupts."""

    theta: FloatArray
    candidates: list[FloatArray] = field(default_factory=list)
    n_flights: int = 0
    n_approaches: int = 0
    start_objective: float | None = None
    objective: float | None = None
    score: Score | None = None
    mean: float = float("nan")


def learn(
    chosen: GeneralExperiment,
    on_progress: Callable[[Progress], None] | None = None,
    threads: int | None = None,
    start: PolicyFile | None = None,
) -> PolicyFile:
    """Learn a policy.

    Args:
        chosen: The experiment.
        on_progress: Told often where learning stands.
        threads: Worker threads; omitted: all processors.
        start: Policy of the same form to search from, beside the one that the map gives.

    Returns:
        The policy; if it was interrupted (Ctrl-C) after the map, the best so far, with `training.interrupted`.

    Raises:
        ConfigError: No landing is possible in the regions, or `start` is of another form.
    """
    run = _Run(chosen, on_progress or (lambda _: None), threads)
    try:
        run.begin(start)
        run.search()
        run.choose()
        run.learn_go()
    except KeyboardInterrupt:
        if run.state is None:
            raise
        return run.result(interrupted=True)
    return run.result(interrupted=False)


class _Run:
    """One run through the stages."""

    def __init__(self, chosen: GeneralExperiment, tell: Callable[[Progress], None], threads: int | None) -> None:
        self._chosen, self._tell, self._threads = chosen, tell, threads
        self._general = General(chosen.form)
        self._places = [Place.of(task) for task in chosen.tasks]
        if chosen.drawn is not None:
            self._places = [m for place in self._places for m in place.members(chosen.drawn, Purpose.FAMILY)]
        self.state: _State | None = None

    def _known(self) -> _State:
        if self.state is None:
            raise RuntimeError("begin comes first")
        return self.state

    def _say(self, stage: str, done: float) -> None:
        known = self.state
        self._tell(Progress(stage, done, known.mean if known else float("nan"), known.n_flights if known else 0))

    def begin(self, start: PolicyFile | None) -> None:
        """The map, and the policies from which the search may begin."""
        general = self._general
        if start is not None and start.form != general.form.name:
            raise ConfigError(f"form {general.form.name}: the policy to start from is of the form {start.form}")
        self._say("map", 0.0)
        chosen = self._chosen
        flown = fly_map(chosen.map, chosen.regions, chosen.seed, general, self._places, self._threads)
        self._best = best = best_of(flown)
        if not best.weight.size:
            raise ConfigError("no approach of these regions ends in a landing, whatever threshold and moment")
        theta = np.array(start.values) if start is not None else fit(general, best)
        self.state = _State(general.always_go(theta), n_flights=best.n_flights)
        if start is None:
            self._say("fit", 0.0)
            most_Nmm = moment_most_Nmm(self._places)
            timing_s = [part * chosen.map.timing_s for part in _TIMINGS_NORM]
            found = polish(general, flown, best, theta, most_Nmm, timing_s, chosen.seed)
            self._begin_with_the_best_of([theta, *found])
        self.state.candidates.append(self.state.theta)
        self._say("fit", 1.0)

    def _begin_with_the_best_of(self, policies: list[FloatArray]) -> None:
        """Flights tell which of the policies that the map gives is the best."""
        known, search = self._known(), self._chosen.search
        approaches = self._draw(self._chosen.regions, Purpose.START, search.n_approaches)
        theta = np.stack(policies)
        scores = objective(fly(self._places, self._general.form.name, theta, approaches, self._threads))
        known.n_flights += len(theta) * sum(map(len, approaches))
        known.theta = theta[int(np.argmax(scores))]

    def search(self) -> None:
        """Any learner, from there; keeps what it recommends now and then."""
        known, n = self._known(), self._chosen.search.n_iterations
        before = known.n_flights
        n_drawn = self._chosen.search.n_approaches * len(self._chosen.regions) * len(self._places)

        def keep(at: search.Iteration) -> None:
            known.theta, known.mean, known.n_flights = at.theta, at.mean, before + at.n_flights
            known.n_approaches = at.number * n_drawn
            if at.number == n or at.number % max(1, n // _N_CHECKPOINTS) == 0:
                known.candidates.append(at.theta)
            self._say("search", at.number / n)

        search.run(self._chosen, self._general, self._places, known.theta, self._best, keep, self._threads)
        if not np.array_equal(known.theta, known.candidates[-1]):
            known.candidates.append(known.theta)

    def choose(self) -> None:
        """The best of start and recommendations, on approaches that none of them has met."""
        known = self._known()
        approaches = self._choosing()
        found = []
        for i, theta in enumerate(known.candidates):
            self._say("choice", i / len(known.candidates))
            flown, *rates = self._rates(_rounded(theta), approaches)
            found.append((float(objective(flown)), *rates))
        best = max(range(len(found)), key=lambda i: found[i][0])
        known.theta, known.start_objective, known.objective = known.candidates[best], found[0][0], found[best][0]
        _, landed, spotless = found[best]
        known.score = Score(landed=landed, clean=spotless, flights=sum(map(len, approaches)))
        self._say("choice", 1.0)

    def _draw(self, regions: list[Region], purpose: Purpose, n: int) -> list[Approaches]:
        """Approaches of a purpose, for each place."""
        return Series(regions, self._chosen.seed, purpose).for_each(len(self._places), n)

    def _choosing(self) -> list[Approaches]:
        return self._draw(self._chosen.regions, Purpose.SELECT, self._chosen.search.n_select)

    def _rates(self, theta: FloatArray, approaches: list[Approaches]) -> tuple[list[Outcomes], float, float]:
        """Outcomes of a policy, and its shares of landings and of clean ones."""
        flown = fly(self._places, self._general.form.name, theta, approaches, self._threads)
        self._known().n_flights += sum(map(len, approaches))
        landed, spotless = (float(np.mean([rate(o).mean() for o in flown])) for rate in (four_leg, clean))
        return flown, landed, spotless

    def learn_go(self) -> None:
        """Probability of a landing, the least one that is flown, and what this does to the score."""
        known, general, settings = self._known(), self._general, self._chosen.go
        drawn = [
            self._draw([settings.region], purpose, n)
            for purpose, n in ((Purpose.GO, settings.n_approaches), (Purpose.HELD_OUT, settings.n_held_out))
        ]
        self._say("go / no-go", 0.0)
        theta = _rounded(known.theta)
        learned = go.fly_decisions(general, self._places, theta, drawn[0], self._threads)
        self._say("go / no-go", 0.6)
        held = go.fly_decisions(general, self._places, theta, drawn[1], self._threads)
        known.n_flights += 2 * (learned.n_flights + held.n_flights)
        if learned.landed.all() or not learned.landed.any():
            self._say("go / no-go", 1.0)
            return  # nothing to tell apart: always go
        coefficients = _rounded(np.clip(go.fit(learned, settings.ridge), *general.bounds[general.go].T))
        p_min = go.choose_p_min(
            go.probabilities(coefficients, held), held, settings.strikes_avoided_min, settings.refused_good_max
        )
        theta[general.go], theta[general.go_p_min] = coefficients, p_min
        score = known.score
        if score is not None and p_min > 0.0:
            self._say("go / no-go", 0.9)
            flown, landed, spotless = self._rates(theta, self._choosing())
            refused = float(np.mean([(outcomes["no_go"] == 1).mean() for outcomes in flown]))
            with_go = WithGo(refused=refused, landed=landed, clean=spotless)
            score = score.model_copy(update={"with_go": with_go})
        known.theta, known.score = theta, score
        self._say("go / no-go", 1.0)

    def result(self, interrupted: bool) -> PolicyFile:
        """The policy file of what is known."""
        known, chosen = self._known(), self._chosen
        training = Training(
            learner=chosen.learner,
            seed=chosen.seed,
            family=chosen.drawn,
            regions=chosen.regions,
            rollouts=known.n_flights,
            approaches=known.n_approaches,
            start_objective=known.start_objective,
            objective=known.objective,
            interrupted=interrupted,
        )
        theta: Sequence[float] = _rounded(known.theta).tolist()
        return file.make(self._general.form, theta, chosen.tasks, training, known.score)


def _rounded(theta: FloatArray) -> FloatArray:
    """The digits that a file keeps."""
    shape = np.shape(theta)
    return np.array([float(f"{value:.{_DIGITS}g}") for value in np.ravel(theta)]).reshape(shape)
