"""The Gymnasium environment: Gymnasium's own checks, the same episode from the same seed, and that it can be flown."""

import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from sitl.frames import standing
from sitl.gym import ACTIONS, HEIGHT_M, LOST, TASKS, YawSitterEnv, reference

pytestmark = pytest.mark.compiled


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("action", ACTIONS)
def test_gymnasium_finds_nothing_wrong_with_it(task: str, action: str) -> None:
    made = gymnasium.make("sitl.gym:YawSitter-v0", task=task, action=action)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message=".*(infinity|render).*")
        check_env(made.unwrapped)


def episode(env: YawSitterEnv, seed: int, steps: int = 50) -> tuple[np.ndarray, list[float]]:
    seen, _ = env.reset(seed=seed)
    rows, rewards = [seen], []
    hand = np.random.default_rng(5)
    for _ in range(steps):
        seen, reward, *_ = env.step(hand.uniform(-0.2, 0.2, 4).astype(np.float32))
        rows.append(seen)
        rewards.append(reward)
    return np.array(rows), rewards


def test_a_seed_gives_the_same_episode_bit_for_bit_whatever_was_flown_before() -> None:
    first, second = (YawSitterEnv(vehicle="yawsitter-real", gust_m_s=0.5) for _ in range(2))
    flown = episode(first, seed=3)
    episode(second, seed=8)
    again = episode(second, seed=3)
    assert np.array_equal(flown[0], again[0])
    assert flown[1] == again[1]
    assert not np.array_equal(flown[0], episode(first, seed=4)[0])


def hold(seen: np.ndarray) -> np.ndarray:
    """Body rates and thrust that keep the vehicle at the reference: a P(D) controller by hand, heading north."""
    position, velocity, q, _, _ = np.split(seen.astype(float), (3, 6, 10, 13))
    wanted = -1.5 * position - 2.0 * velocity
    lean = np.clip(wanted[:2] / 9.81, -0.3, 0.3)
    target = np.array(standing(0.0, np.radians(99.5) - lean[0]))
    w, x, y, z = q * (1, -1, -1, -1)
    a, b, c, d = target
    error = 2.0 * np.array(
        (w * b + x * a + y * d - z * c, w * c - x * d + y * a + z * b, w * d + x * c - y * b + z * a)
    )
    error[2] += lean[1]
    thrust_N = 1.076 * (9.81 - wanted[2])
    return np.clip([*(4.0 * error / 3.0), thrust_N / 11.0 - 1.0], -1.0, 1.0).astype(np.float32)


@pytest.mark.parametrize("task", TASKS)
def test_a_simple_controller_stays_near_the_reference_until_the_episode_is_truncated(task: str) -> None:
    env = YawSitterEnv(task, "rates", episode_s=8.0)
    seen, _ = env.reset(seed=1)
    total, steps, over, lost = 0.0, 0, False, False
    while not (over or lost):
        seen, reward, lost, over, info = env.step(hold(seen))
        total, steps = total + reward, steps + 1
    assert (steps, over, lost) == (400, True, False)
    assert info["true_error_m"] < 1.5
    assert total / steps > 0.4


def test_full_thrust_ends_the_episode_as_lost_and_so_does_the_ground() -> None:
    for action in ((1.0, 1.0, 0.0, 0.0), (-1.0, -1.0, 0.0, 0.0)):
        env = YawSitterEnv()
        env.reset(seed=2)
        for _ in range(500):
            _, reward, lost, over, _ = env.step(np.array(action, dtype=np.float32))
            if lost or over:
                break
        assert (lost, over, reward) == (True, False, LOST)


def test_the_observation_is_the_navigation_state_less_the_reference() -> None:
    env = YawSitterEnv("track", vehicle="yawsitter-real")
    rows, _ = episode(env, seed=6, steps=20)
    assert env.vehicle is not None
    nav, (position, velocity) = env.vehicle.snapshot().nav, reference("track", 0.4)
    np.testing.assert_allclose(rows[-1][:3], np.subtract(nav[:3], position), rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(rows[-1][13:], velocity, rtol=1e-6)
    assert abs(rows[0][2]) < 0.6
    assert env.vehicle.snapshot().truth.down_m == pytest.approx(-HEIGHT_M, abs=1.0)


def test_the_circles_velocity_is_the_change_of_its_position() -> None:
    for t in (0.0, 0.3, 2.0, 9.0):
        ahead, behind = (np.array(reference("track", t + dt)[0]) for dt in (1e-6, -1e-6))
        np.testing.assert_allclose((ahead - behind) / 2e-6, reference("track", t)[1], atol=1e-6)


@pytest.mark.parametrize(("name", "value"), [("task", "loop"), ("action", "sticks"), ("episode_s", 0.0)])
def test_settings_that_do_not_exist_are_refused_by_name(name: str, value: object) -> None:
    with pytest.raises(ValueError, match=name):
        YawSitterEnv(**{name: value})
