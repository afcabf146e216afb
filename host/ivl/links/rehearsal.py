"""A rehearsal with a software vehicle of its own: `rehearsal://`, which is what `--rehearse` flies without `--uri`."""

from dataclasses import replace

from ivl.errors import ConfigError
from ivl.experiment import Experiment
from ivl.links.crazyflie import CrazyflieSource
from ivl.links.operators import ConsoleOperator
from ivl.links.options import Options
from ivl.rehearsal.day import Day
from ivl.rehearsal.hands import Hands
from ivl.silproc import SilProcess
from ivl.site.require import OWN_CAMERAS, refuse_without_site

URI = "rehearsal://"


class RehearsalSource(CrazyflieSource):
    """Flies a software vehicle as if it were a drone; the vehicle is started in the experiment's world, and ended."""

    def __init__(self, experiment: Experiment, options: Options | None = None) -> None:
        """Start the vehicle, and then as `CrazyflieSource`, whose errors it has.

        Raises:
            ConfigError: A tracking system is named; the day has cameras of its own.
        """
        options = replace(options or Options(), rehearse=True)
        if options.mocap is not None:
            raise ConfigError(OWN_CAMERAS)
        seed = 0 if options.script is None else options.script.seed
        self.server = SilProcess(experiment.make_world(), seed=seed)
        self.server.start()
        try:
            super().__init__(self.server.uri, experiment, self._with_day(experiment, options))
        except BaseException:
            self.server.kill()
            raise

    def _with_day(self, experiment: Experiment, options: Options) -> Options:
        """The options with the day that the script makes of them."""
        script = options.script
        if script is None:
            return options
        site = refuse_without_site(options.site_of(experiment, URI))
        day = Day(script, site, experiment.budget, self.server, options.folder, options.say)
        person = None if options.answered_by_script else options.operator or ConsoleOperator()
        deadlines = replace(options.deadlines, return_s=script.return_s)
        return replace(options, day=day, operator=Hands(day, person), deadlines=deadlines)

    def close(self) -> None:
        """As the base, and end the vehicle; again does nothing."""
        try:
            super().close()
        finally:
            self.server.kill()
