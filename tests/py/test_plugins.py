"""Rewards and learners that are in no file of the package: they learn, are stored, resumed and reported by name."""

import sys
from pathlib import Path
from typing import Any

import pytest

import ivl
from ivl import cli, report
from ivl.errors import ConfigError
from ivl.learners import LEARNERS
from ivl.rewards import REWARDS

SHORT = {
    "budget": 8,
    "n_rollouts": 4,
    "check.n_fresh": 5,
    "check.effort": 0.02,
    "check.grid": {
        "rrev_c_per_s": {"lo": 4.5, "hi": 5.0, "step": 0.25},
        "moment_y_Nmm": {"lo": 7.0, "hi": 9.0, "step": 1.0},
    },
}
SOURCE = '''
"""A module of a user."""
from typing import ClassVar

import numpy as np
from pydantic import Field

import ivl
from ivl.learners import Options


def feet(outcomes):
    """Pays for feet alone."""
    return 10.0 * outcomes.n_legs


class Wander(ivl.Learner):
    """Keeps the best policy so far, and looks near it."""

    class Options(Options):
        step: float = Field(default=0.3, gt=0, description="spread")

    Options: ClassVar = Options

    def _setup(self):
        self.best, self.most = self.mu0, -1.0

    def _ask(self, n):
        spread = self.options.step * self.sigma0
        return np.clip(self.best + spread * self._rng.standard_normal((n, self.dim)), self.lo, self.hi)

    def _update(self, theta, rewards, meta):
        if rewards.max() > self.most:
            self.best, self.most = theta[rewards.argmax()], float(rewards.max())

    def _distribution(self):
        return self.best, self.options.step * self.sigma0

    def _recommended(self):
        return self.best

    def _state(self):
        return {"best": self.best.tolist(), "most": self.most}

    def _load(self, state):
        self.best, self.most = np.array(state["best"]), state["most"]


class Half(ivl.Learner):
    """Lacks nearly everything."""


hasty = ivl.Reward(
    name="hasty",
    doc="Pays for haste.",
    terms=(ivl.Quantity("haste", "1/s", "one over the duration"),),
    compute=lambda outcomes, options: {"haste": 1 / outcomes["t_end_s"], "total": 1 / outcomes["t_end_s"]},
)
negative = lambda outcomes: -1.0 * outcomes.n_legs
short = lambda outcomes: outcomes.n_legs[:1]
number = 7
'''


@pytest.fixture
def mine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder on the path with a module `ivl_of_a_user`."""
    folder = tmp_path / "packages"
    folder.mkdir()
    (folder / "ivl_of_a_user.py").write_text(SOURCE)
    monkeypatch.syspath_prepend(folder)
    monkeypatch.delitem(sys.modules, "ivl_of_a_user", raising=False)
    return folder


@pytest.mark.usefixtures("mine")
def test_a_run_with_own_reward_and_learner_is_cut_resumed_and_reported(tmp_path: Path) -> None:
    import ivl_of_a_user as user

    def interrupt(_progress: Any) -> None:
        raise KeyboardInterrupt

    call = {"learner": user.Wander, "reward": user.feet, "out": tmp_path / "cut", **SHORT, "learner.options.step": 0.2}
    with pytest.raises(KeyboardInterrupt):
        ivl.learn("paper_vertical", on_episode=interrupt, **call)
    assert cli.run(["learn", "--resume", "--out", str(tmp_path / "cut"), "--json"]) == 0
    whole = ivl.learn("paper_vertical", **{**call, "out": tmp_path / "whole"})
    frame = ivl.load(tmp_path / "cut").rollouts()
    assert frame.equals(whole.rollouts())
    assert (frame["reward"] == 10.0 * frame["n_legs"]).all()
    assert set(frame["learner"]) == {"ivl_of_a_user:Wander"}
    assert whole.experiment.learner.options == {"step": 0.2}
    assert set(whole.manifest["plugins"]) == {"learner", "reward"}
    assert "Keeps the best policy so far" in report.page.learner_words(whole.experiment.learner.name)
    assert report.write(tmp_path / "whole").n_different == 0


def test_a_source_that_changed_is_said_when_the_run_goes_on(mine: Path, tmp_path: Path) -> None:
    def interrupt(_progress: Any) -> None:
        raise KeyboardInterrupt

    call = {"reward": "ivl_of_a_user:hasty", "learner": "ephe", "out": tmp_path / "run", **SHORT}
    with pytest.raises(KeyboardInterrupt):
        ivl.learn("paper_vertical", on_episode=interrupt, **call)
    (mine / "ivl_of_a_user.py").write_text(SOURCE + "\n# changed\n")
    run = ivl.learn("paper_vertical", resume=True, **call)
    assert run.result is not None
    assert "reward ivl_of_a_user:hasty: its source changed since the run began" in run.result["warnings"]
    assert (run.rollouts()["reward_haste"] == 1 / run.rollouts()["t_end_s"]).all()


def test_where_it_cannot_be_imported_a_run_says_so(
    mine: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    ivl.learn("paper_vertical", learner="ephe", reward="ivl_of_a_user:feet", out=out, **SHORT)
    monkeypatch.delitem(sys.modules, "ivl_of_a_user")
    monkeypatch.setattr(sys, "path", [path for path in sys.path if path != str(mine)])
    assert cli.run(["report", str(out)]) == 2
    told = capsys.readouterr().err
    assert "ivl_of_a_user cannot be imported" in told
    assert "is its folder on PYTHONPATH?" in told


def test_an_installed_package_gives_more_by_entry_points(
    mine: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    info = mine / "their_package-1.2.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: their-package\nVersion: 1.2\n")
    (info / "entry_points.txt").write_text(
        "[ivl.rewards]\nfeet = ivl_of_a_user:feet\nlost = nowhere_at_all:x\n"
        "[ivl.learners]\nwander = ivl_of_a_user:Wander\n"
    )
    run = ivl.learn("paper_vertical", learner="wander", reward="feet", out=tmp_path / "run", **SHORT)
    assert (run.rollouts()["reward"] == 10.0 * run.rollouts()["n_legs"]).all()
    assert run.manifest["plugins"]["reward"]["package"] == "their-package 1.2"
    assert "wander" in LEARNERS.names()
    assert cli.run(["list", "learners"]) == 0
    assert "Keeps the best policy so far" in capsys.readouterr().out
    with pytest.raises(ConfigError, match="reward 'lost': nowhere_at_all:x cannot be imported"):
        REWARDS["lost"]


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ({"reward": "ivl_of_a_user:feat"}, "ivl_of_a_user has no 'feat', did you mean 'feet'"),
        ({"reward": "ivl_of_a_user:number"}, "is of the kind int, expected a Reward or a function of outcomes"),
        ({"reward": "ivl_of_a_user:negative"}, "is out of range"),
        ({"reward": "ivl_of_a_user:short"}, r"shape \(1,\) \(expected \(4,\)"),
        ({"reward": "ivl_of_a_user"}, "no reward 'ivl_of_a_user'"),
        ({"reward": "../x:y"}, "expected module:name"),
        ({"learner": "ivl_of_a_user:feet"}, "function is no subclass of ivl.Learner"),
        ({"learner": "ivl_of_a_user:Half"}, "Half has yet to define _ask"),
        ({"learner": "ivl_of_a_user:Wander", "learner.options.stp": 1.0}, "stp: unknown key"),
        ({"reward": lambda outcomes: outcomes.n_legs}, "cannot be imported: define it at the top level"),
        ({"reward": "ivl_of_a_user:hasty", "reward.options.weights.hast": 1.0}, "weights.hast: no such term"),
    ],
)
@pytest.mark.usefixtures("mine")
def test_mistakes_in_own_code_are_said_in_one_line(tmp_path: Path, option: dict[str, Any], message: str) -> None:
    with pytest.raises(ivl.IvlError, match=message):
        ivl.learn("paper_vertical", **{"learner": "ephe", "out": tmp_path / "run", **SHORT, **option})


def test_a_notebook_can_learn_with_what_it_defines(tmp_path: Path) -> None:
    main = sys.modules["__main__"]
    exec(compile("def toes(outcomes):\n    return 1.0 * outcomes.n_legs\n", "<notebook>", "exec"), main.__dict__)
    try:
        run = ivl.learn("paper_vertical", learner="ephe", reward=main.toes, out=tmp_path / "run", **SHORT)
        assert run.experiment.reward.name == "__main__:toes"
        assert (run.rollouts()["reward"] == run.rollouts()["n_legs"]).all()
        with pytest.raises(ConfigError, match="worker processes cannot import it"):
            ivl.sweep("smoke", reward=main.toes)
    finally:
        del main.toes


@pytest.mark.usefixtures("mine")
def test_a_sweep_flies_with_them(tmp_path: Path) -> None:
    run = ivl.sweep(
        "smoke", learner="ivl_of_a_user:Wander", reward="ivl_of_a_user:feet", out=tmp_path / "run", workers=1, trials=1,
        gears=["wide_long"], speeds_mps=[2.5], angles_deg=[90.0], budget=8, keep_rollouts=True,
    )  # fmt: skip
    assert isinstance(run, ivl.SweepRun)
    assert len(run.failures()) == 0
    assert (run.rollouts()["reward"] == 10.0 * run.rollouts()["n_legs"]).all()
    assert "1 trials" in repr(run)
