"""A rehearsal with a software vehicle of its own: `rehearsal://`, which is what `--rehearse` flies without `--uri`."""

from dataclasses import replace

from ivl.experiment import Experiment
from ivl.links.crazyflie import CrazyflieSource
from ivl.links.options import Options
from ivl.silproc import SilProcess

URI = "rehearsal://"


class RehearsalSource(CrazyflieSource):
    """Flies a software vehicle as if it were a drone; the vehicle is started in the experiment's world, and ended."""

    def __init__(self, experiment: Experiment, options: Options | None = None) -> None:
        """Start the vehicle, and then as `CrazyflieSource`, whose errors it has."""
        self.server = SilProcess(experiment.make_world())
        self.server.start()
        try:
            super().__init__(self.server.uri, experiment, replace(options or Options(), rehearse=True))
        except BaseException:
            self.server.kill()
            raise

    def close(self) -> None:
        """As the base, and end the vehicle; again does nothing."""
        try:
            super().close()
        finally:
            self.server.kill()
