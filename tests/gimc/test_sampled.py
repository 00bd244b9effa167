"""Discretisation, sampled filters and observers."""

import tracemalloc

import control
import numpy as np
import pytest
import scipy.integrate
import scipy.linalg
import scipy.signal
from hypothesis import given, settings
from hypothesis import strategies as st
from synthesis_problems import random_system, siso, stiff_plant

import gimc
from gimc import Abcd, SampledFilter, SampledObserver, abcd, discretise, sampled_observer, sampling_error

RATES_HZ = [10, 20, 50, 100]


@given(st.integers(0, 10**6), st.integers(1, 7), st.integers(1, 3), st.integers(1, 3), st.floats(0.01, 0.5))
@settings(max_examples=30, deadline=None, derandomize=True)
def test_zoh_and_tustin_are_scipys(seed: int, n: int, m: int, p: int, h: float) -> None:
    system = random_system(seed, n, m, p, stable=True)
    w = np.linspace(0.01, 0.9, 20) * np.pi / h
    for method, theirs in (("zoh", "zoh"), ("tustin", "bilinear"), ("foh", "foh")):
        reference = gimc.Sampled(*scipy.signal.cont2discrete(tuple(system), h, theirs)[:4], h)
        ours = discretise(system, h, method)  # type: ignore[arg-type]
        np.testing.assert_allclose(ours.response(w), reference.response(w), rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("rate_hz", RATES_HZ)
@pytest.mark.parametrize("seed", range(3))
def test_filters_are_faithful_up_to_a_tenth_of_the_rate(rate_hz: int, seed: int) -> None:
    """The same continuous filter serves every rate; "foh" keeps it without delay, and stable with poles at -600."""
    system = gimc.scale(stiff_plant(seed), [1e-4, 0.3, 0.5], [20.0, 0.05, 0.01, 3.0])
    sampled = discretise(system, 1 / rate_hz)
    assert sampling_error(system, sampled) < 0.02
    assert np.abs(np.linalg.eigvals(sampled.A)).max() < 1
    delayed = discretise(system, 1 / rate_hz, "zoh")
    assert sampling_error(system, sampled) < sampling_error(system, delayed)


def test_sampling_error_is_the_definition() -> None:
    lag, h = siso([1], [10, 1]), 0.1
    w = 2 * np.pi * 0.1 / h
    zoh = discretise(lag, h, "zoh")
    z = np.exp(1j * w * h)
    at_top = abs((1 - np.exp(-h / 10)) / (z - np.exp(-h / 10)) - 1 / (10j * w + 1))
    grid = np.linspace(1e-3, w, 4000)
    exact = np.abs((1 - np.exp(-h / 10)) / (np.exp(1j * grid * h) - np.exp(-h / 10)) - 1 / (10j * grid + 1)).max()
    assert sampling_error(lag, zoh) == pytest.approx(exact, rel=1e-2)
    assert exact >= at_top * (1.0 - 1e-12)  # the grid's last point is the top
    foh = np.abs(np.sinc(grid * h / (2 * np.pi)) ** -2 - 1)  # of a triangle's spectrum, aliases left out
    assert sampling_error(lag, discretise(lag, h, "foh")) < min(exact, foh.max())


def test_filter_steps_as_scipy_simulates() -> None:
    system = random_system(1, 6, 2, 3, stable=True)
    sampled = discretise(system, 0.1, "foh")
    u = np.random.default_rng(0).normal(size=(300, 2))
    _, expected, _ = scipy.signal.dlsim((sampled.A, sampled.B, sampled.C, sampled.D, 0.1), u)
    run = SampledFilter(sampled)
    found = np.array([run.step(row).copy() for row in u])
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-10)
    run.reset()
    np.testing.assert_array_equal(run.state, 0.0)
    np.testing.assert_allclose(run.step(u[0]), expected[0], atol=1e-12)


def test_rest_is_bumpless() -> None:
    sampled = discretise(random_system(2, 5, 2, 2, stable=True), 0.05)
    run = SampledFilter(sampled)
    u = np.array([3.0, -1.0])
    output = run.rest_at(u)
    for _ in range(50):
        np.testing.assert_allclose(run.step(u), output, rtol=1e-9)


@pytest.mark.parametrize("n", [0, 1])
def test_filters_without_and_with_state(n: int) -> None:
    gain = abcd(np.array([[2.0, 1.0]])) if n == 0 else random_system(0, 1, 2, 1, stable=True)
    sampled, u = discretise(gain, 0.1), np.array([1.0, 4.0])
    run = SampledFilter(sampled)
    for _ in range(3):
        run.step(u)
    A, B, C, D = (np.asarray(matrix) for matrix in (sampled.A, sampled.B, sampled.C, sampled.D))
    state = B @ u + A @ B @ u + A @ A @ B @ u
    np.testing.assert_allclose(run.step(u), C @ state + D @ u, rtol=1e-12)
    if n == 0:
        assert run.step(u)[0] == 6.0


def test_steps_do_not_allocate() -> None:
    run = SampledFilter(discretise(random_system(3, 12, 3, 2, stable=True), 0.1))
    observer = SampledObserver(sampled_observer(stiff_plant(0), 0.1, measurement=[4e4, 0.01, 0.0025]))
    u, y, v = np.ones(3), np.ones(3), np.ones(4)

    def ticks(number: int) -> None:
        for _ in range(number):
            run.step(u)
            observer.innovate(y)
            observer.advance(v)

    ticks(10)
    tracemalloc.start()
    ticks(10)
    before, _ = tracemalloc.get_traced_memory()
    tracemalloc.reset_peak()
    ticks(1000)
    after, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert after - before < 200
    assert peak - before < 600  # less than one state vector each; counters and frames only


def held_inputs_response(system: Abcd, u: np.ndarray, h: float) -> np.ndarray:
    """Outputs at the sampling instants by an implicit integrator of the continuous plant, inputs held in between."""
    x, outputs = np.zeros(system.A.shape[0]), []
    for row in u:
        outputs.append(system.C @ x)
        forced = scipy.integrate.solve_ivp(
            lambda _, state, row=row: system.A @ state + system.B @ row,
            (0.0, h), x, method="Radau", jac=system.A, rtol=1e-11, atol=1e-13,
        )  # fmt: skip
        x = forced.y[:, -1]
    return np.array(outputs)


def test_innovation_is_zero_against_an_integrator() -> None:
    """A fault-free continuous plant under held inputs gives no innovation at the sampling instants."""
    system = random_system(6, 4, 2, 2, stable=True, direct=False)
    u = np.random.default_rng(1).normal(size=(40, 2))
    y = held_inputs_response(system, u, 0.1)
    observer = SampledObserver(sampled_observer(system, 0.1))
    for measured, command in zip(y, u, strict=True):
        assert np.abs(observer.innovate(measured)).max() < 1e-8 * np.abs(y).max()
        observer.advance(command)


@pytest.mark.parametrize("rate_hz", RATES_HZ)
@pytest.mark.parametrize("seed", range(3))
def test_innovation_of_a_stiff_plant(rate_hz: int, seed: int) -> None:
    system, noise = stiff_plant(seed), np.array([200.0, 0.1, 0.05])
    excited = system.B * np.array([1.0, 0.01, 0.01, 1.0])
    design = sampled_observer(system, 1 / rate_hz, excited @ excited.T, noise**2)
    plant = discretise(system, 1 / rate_hz, "zoh")
    observer, x = SampledObserver(design), np.zeros(11)
    commands = np.random.default_rng(seed).normal(size=(500, 4)) * np.array([20.0, 0.05, 0.01, 3.0])
    for command in commands:
        assert (np.abs(observer.innovate(plant.C @ x)) < 1e-8 * noise).all()
        observer.advance(command)
        x = plant.A @ x + plant.B @ command
    stable = design.plant.A + design.L @ design.plant.C
    d = gimc.scaling.balancing_scales(stable, np.zeros((11, 0)), np.zeros((0, 11)))
    assert np.abs(np.linalg.eigvals(stable * d / d[:, None])).max() < 1


def test_observer_is_the_coprime_factors() -> None:
    """`f_e = N u - M y` with M = (A+LC, L, C, I), N = (A+LC, B, C, 0), run as filters, against the observer's ticks."""
    system = random_system(8, 5, 2, 3, stable=True, direct=False)
    design = sampled_observer(system, 0.1)
    P, L = design.plant, design.L
    closed = P.A + L @ P.C
    N = SampledFilter(gimc.Sampled(closed, P.B, P.C, np.zeros((3, 2)), 0.1))
    M = SampledFilter(gimc.Sampled(closed, L, P.C, np.eye(3), 0.1))
    observer = SampledObserver(design)
    random = np.random.default_rng(3)
    for _ in range(100):
        u, y = random.normal(size=2), random.normal(size=3)
        np.testing.assert_allclose(observer.innovate(y), N.step(u) - M.step(y), atol=1e-10)
        observer.advance(u)


def test_gain_approaches_the_continuous_filter() -> None:
    """L / h tends to the continuous Kalman gain as the sample time goes to zero."""
    system = random_system(11, 4, 2, 2, direct=False)
    continuous = gimc.filter_gain(system)
    errors = [np.abs(sampled_observer(system, h).L / h - continuous).max() for h in (1e-2, 1e-3, 1e-4)]
    assert errors[1] < 0.3 * errors[0]
    assert errors[2] < 0.3 * errors[1]
    assert errors[2] < 1e-2 * np.abs(continuous).max()


def test_innovation_covariance_is_that_of_a_simulation() -> None:
    """White innovations with the covariance that the design states (thresholds are made from it)."""
    system = random_system(12, 3, 1, 2, stable=True, direct=False)
    h, random = 0.1, np.random.default_rng(4)
    R = np.array([0.5, 0.2])
    design = sampled_observer(system, h, measurement=R)
    plant, observer = design.plant, SampledObserver(design)
    fine = 200
    step = scipy.linalg.expm(system.A * h / fine)
    x, innovations = np.zeros(3), []
    for _ in range(4000):
        y = plant.C @ x + random.normal(size=2) * np.sqrt(R / h)
        innovations.append(observer.innovate(y).copy())
        observer.advance(np.zeros(1))
        for kick in random.normal(size=(fine, 1)) * np.sqrt(h / fine):
            x = step @ x + system.B @ kick
    innovations = np.array(innovations[200:])
    np.testing.assert_allclose(np.cov(innovations.T), design.covariance, atol=0.1 * design.covariance.max())
    lagged = innovations[1:].T @ innovations[:-1] / len(innovations)
    assert np.abs(lagged).max() < 0.1 * design.covariance.max()


def test_errors() -> None:
    system = siso([1], [1, 1])
    with pytest.raises(ValueError, match="finite positive number"):
        discretise(system, 0.0)
    with pytest.raises(ValueError, match="'zoh', 'foh', 'tustin'"):
        discretise(system, 0.1, "euler")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="direct term"):
        sampled_observer(siso([1, 0], [1, 1]), 0.1)
    with pytest.raises(gimc.NotDetectableError, match="mode at 0"):
        sampled_observer(control.ss(np.diag([0.0, -1]), [[1], [1]], [[0, 1]], 0), 0.1)
