"""The environment of Gymnasium: its checker, what a flip is, and that the vector form is many single ones."""

import warnings
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import ivl
import ivl.gym
from ivl.gym import LandingEnv, LandingVectorEnv

WAIT, FLIP = np.array([-1.0, 0.0], dtype=np.float32), np.array([1.0, 0.5], dtype=np.float32)
NOISE = "paper_vertical_noise"
DRAWN = {"speed_mps": (2.0, 3.0), "angle_deg": (60.0, 90.0)}


@pytest.fixture(scope="module")
def env() -> LandingEnv:
    return LandingEnv(NOISE, **DRAWN)


def test_the_checker_of_gymnasium_has_nothing_to_say() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        made = gymnasium.make(ivl.gym.ENV_ID, task=NOISE)
        check_env(made.unwrapped)
        assert made.reset(seed=1)[0].shape == (5,)


def test_the_vector_form_is_made_and_flown_without_a_warning() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        envs = gymnasium.make_vec(ivl.gym.ENV_ID, num_envs=3, task=NOISE)
        seen, _ = envs.reset(seed=1)
        assert envs.observation_space.contains(seen)
        envs.action_space.seed(1)
        for _ in range(150):
            seen, rewards, ends, cuts, _ = envs.step(envs.action_space.sample())
            assert envs.observation_space.contains(seen)
            assert (rewards.shape, ends.dtype, cuts.dtype) == ((3,), np.dtype(bool), np.dtype(bool))
        envs.close()


def test_speed_is_measured_for_steps_and_for_the_landings_that_end() -> None:
    from ivl.gym import speed

    rates = speed.measure(16, 60)
    assert rates["gym_steps_per_s_16"] > rates["gym_landings_per_s_16"] > 0.0


@pytest.mark.parametrize("n_wait", [3, 20, 45])
def test_a_flip_is_the_landing_that_the_simulator_flies(env: LandingEnv, n_wait: int) -> None:
    env.reset(seed=11)
    for _ in range(n_wait):
        seen, reward, over, _, info = env.step(WAIT)
        assert (reward, over, info) == (0.0, False, {})
    _, reward, over, cut, info = env.step(FLIP)
    assert (over, cut) == (True, False)
    draw = env.landings.draw(np.random.Generator(np.random.PCG64(np.random.SeedSequence(11))))
    assert (info["speed_mps"], info["angle_deg"]) == (draw.speed_mps, draw.angle_deg)
    world, lo_hi = env.landings.experiment.make_world(), env.landings.experiment.policy.bounds[1]
    at_s = (n_wait + 1) * 0.01
    moment = lo_hi[0] + 0.75 * (lo_hi[1] - lo_hi[0])
    call = {"seed": draw.seed, "stream": 0, "moment_y_Nmm": moment}
    out = world.rollouts(draw.speed_mps, draw.angle_deg, 0.0, flip_at_s=at_s, **call)
    assert reward == env.landings.experiment.reward.score(out.reshape(1))["total"][0]
    assert info["n_legs"] == out.n_legs
    trace = world.trace(draw.speed_mps, draw.angle_deg, 0.0, flip_at_s=at_s, period_s=0.01, **call)
    row = trace.rows[np.argmin(np.abs(trace.rows.t_s - at_s))]
    assert seen.tolist() == [
        np.float32(row[name]) for name in ("rrev_per_s", "of_y_radps", "d_sensed_m", "d_sigma_m")
    ] + [float(row.d_sensed_m > 0)]
    with pytest.raises(ivl.ConfigError, match="call reset"):
        env.step(WAIT)


@pytest.mark.parametrize("sensing", [None, "camera50"])
def test_a_timed_flip_equals_one_by_the_threshold(sensing: str | None) -> None:
    world = ivl.World("habas2021", "wide_long", "as_simulated", sensing)
    by_threshold = world.rollouts(2.5, 70.0, np.linspace(2.0, 6.0, 12), 8.0, seed=4)
    timed = world.rollouts(2.5, 70.0, 20.0, 8.0, seed=4, flip_at_s=by_threshold.t_trigger_s)
    assert by_threshold.triggered.all()
    assert by_threshold.tobytes() == timed.tobytes()
    rows = world.approaches(2.5, 70.0, 120, seed=4, stream=np.arange(12), threads=2)
    trace = world.trace(2.5, 70.0, 3.0, 8.0, seed=4, stream=3, period_s=0.01)
    before = trace.rows[trace.rows.t_s < trace.outcome.t_trigger_s]
    for name in before.dtype.names:
        assert np.array_equal(rows[name][3, : len(before)], before[name], equal_nan=True)
    contact = world.rollouts(2.5, 70.0, 0.0, 8.0, seed=4, stream=np.arange(12), flip_at_s=60.0).t_impact_s
    assert (np.nanmax(rows.t_s, axis=1) < contact).all()
    assert (np.nanmax(rows.t_s, axis=1) > contact - 0.011).all()


def test_what_cannot_be_timed_is_refused(world: ivl.World) -> None:
    with pytest.raises(ivl.ArgumentError, match="only a policy of the form constant"):
        world.rollouts(2.5, 90.0, *[0.0] * ivl.forms.by_name("bilinear").n, form="bilinear", flip_at_s=0.5)
    with pytest.raises(ivl.ArgumentError, match=r"flip_at_s: value -1\.0 is out of range"):
        world.rollouts(2.5, 90.0, 4.8, 8.0, flip_at_s=-1.0)


def test_the_vector_form_is_many_single_ones() -> None:
    n, rng = 5, np.random.default_rng(2)
    envs = LandingVectorEnv(n, NOISE, threads=2, **DRAWN)
    single = [LandingEnv(NOISE, **DRAWN) for _ in range(n)]
    seen, _ = envs.reset(seed=30)
    assert (seen == [each.reset(seed=30 + i)[0] for i, each in enumerate(single)]).all()
    over, ended = np.zeros(n, dtype=bool), 0
    for _ in range(260):
        actions = rng.uniform(-1, 1, (n, 2)).astype(np.float32)
        actions[:, 0] -= 0.96
        seen, rewards, ends, cuts, infos = envs.step(actions)
        for i, each in enumerate(single):
            if over[i]:
                expected: Any = (each.reset()[0], 0.0, False, False, {})
            else:
                expected = each.step(actions[i])
            assert (seen[i] == expected[0]).all()
            assert (rewards[i], ends[i], cuts[i]) == expected[1:4]
            for name, value in expected[4].items():
                assert infos[name][i] == value
        over, ended = ends, ended + int(ends.sum())
    assert ended > 2 * n


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: LandingEnv("paper_vertcal"), "did you mean 'paper_vertical'"),
        (lambda: LandingEnv(speed_mps=(3.0, 2.0)), "speed_mps: 3 .. 2 is not in order"),
        (lambda: LandingEnv(angle_deg=195.0), "angle_deg: value 195.0 is out of range"),
        (lambda: LandingEnv(reward="papr"), "no reward 'papr'"),
        (lambda: LandingEnv().reset(options={"sped": 1.0}), "no option 'sped'"),
        (lambda: LandingVectorEnv(2).reset(options={"speed_mps": 1.0}), "there are none here"),
        (lambda: LandingVectorEnv(2).step(np.zeros((2, 2))), "call reset"),
    ],
)
def test_mistakes_are_answered(call: Any, message: str) -> None:
    with pytest.raises(ivl.IvlError, match=message):
        call()


def test_an_episode_may_be_asked_for(env: LandingEnv) -> None:
    env.reset(seed=1, options={"speed_mps": 2.2, "angle_deg": 75.0})
    info = env.step(FLIP)[4]
    assert (info["speed_mps"], info["angle_deg"]) == (2.2, 75.0)


def test_the_example_learns(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "examples")
    import reinforce

    rates = reinforce.learn("paper_vertical", 512, seed=0)
    assert np.mean(rates[-3:]) > np.mean(rates[:3]) + 0.05
