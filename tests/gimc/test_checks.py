"""What comes from outside is refused in one line, by the documented exception, before it makes numbers."""

from collections.abc import Callable
from typing import Any

import control
import numpy as np
import pytest
from synthesis_problems import regulator, siso

import gimc
from gimc import Abcd, abcd

LAG = siso([1], [1, 1])
ONE = np.ones((1, 1))
NAN = Abcd(np.array([[np.nan]]), ONE, ONE, ONE)
CROOKED = Abcd(np.eye(2), np.ones((3, 1)), np.ones((1, 2)), np.zeros((1, 1)))
UNSTABLE = Abcd(ONE, ONE, ONE, 0 * ONE)
PLANT = regulator(np.array([[0.0, 1.0], [-2.0, -3.0]]), np.array([[-3.0], [-1.0]]), 0.1)


def complex_system() -> control.StateSpace:
    system = control.ss(-1, 1, 1, 0)
    system.A = np.array([[-1 + 5j]])
    return system


NO_SYSTEMS = {
    "not finite": NAN,
    "have shapes": CROOKED,
    "no state-space matrices": control.frd([1 + 1j, 2.0], [1.0, 2.0]),
    "complex": complex_system(),
    "a gain has complex entries": np.array([[3 + 10j]]),
    "3 dimensions": np.zeros((2, 2, 2)),
    "must be numbers": "plant",
    "sampled with dt": control.tf([1], [1, 0.5], 0.1),
}
FUNCTIONS: dict[str, Callable[[Any], Any]] = {
    "abcd": abcd,
    "hinf_norm": gimc.hinf_norm,
    "sweep_norm": gimc.sweep_norm,
    "poles": gimc.poles,
    "hankel_values": gimc.hankel_values,
    "reduce_order": gimc.reduce_order,
    "minimal_realisation": gimc.minimal_realisation,
    "lcf": gimc.lcf,
    "filter_gain": gimc.filter_gain,
    "discretise": lambda sys: gimc.discretise(sys, 0.1),
    "sampled_observer": lambda sys: gimc.sampled_observer(sys, 0.1),
    "hinfsyn": lambda sys: gimc.hinfsyn(sys, 1, 1),
    "matching_lower_bound": lambda sys: gimc.matching_lower_bound(sys, 1, 1),
    "model_matching": lambda sys: gimc.model_matching(sys, 1, 1),
    "isolation_filter": lambda sys: gimc.isolation_filter(sys, LAG, LAG, 0.1),
    "lft": lambda sys: gimc.lft(np.eye(2), sys, 1, 1),
    "series": lambda sys: gimc.series(LAG, sys),
}


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("words", NO_SYSTEMS)
def test_no_system(words: str, name: str) -> None:
    with pytest.raises(ValueError, match=words) as raised:
        FUNCTIONS[name](NO_SYSTEMS[words])
    assert "\n" not in str(raised.value)


PAIR = np.eye(2)
OPTIONS: dict[str, tuple[Callable[[], Any], str]] = {
    **{
        f"hinfsyn {name}={value}": (
            lambda name=name, value=value: gimc.hinfsyn(PLANT, 2, 1, **{name: value}),
            f"{name} = .*must be",
        )
        for name, values in {
            "rtol": (1e-16, 0.0, -1.0, np.nan, np.inf, 2.0),
            "backoff": (-1.0, np.nan, np.inf),
            "gamma_max": (0.0, -1.0, np.nan, np.inf),
        }.items()
        for value in values
    },
    **{
        f"hinf_norm rtol={value}": (lambda value=value: gimc.hinf_norm(LAG, rtol=value), "rtol = ")
        for value in (1e-16, -1.0, np.nan, np.inf)
    },
    **{
        f"sample time {value}": (lambda value=value: gimc.discretise(LAG, value), "sample_time_s = .*finite positive")
        for value in (0.0, -1.0, np.nan, np.inf, None)
    },
    **{
        f"observer's sample time {value}": (lambda value=value: gimc.sampled_observer(LAG, value), "sample_time_s = ")
        for value in (0.0, np.nan, np.inf)
    },
    "unstable pole": (lambda: gimc.discretise(UNSTABLE, 1e4), "beyond all numbers"),
    "negative Q": (lambda: gimc.sampled_observer(LAG, 0.1, -ONE), "process .* nonnegative definite"),
    "indefinite Q": (lambda: gimc.filter_gain(gimc.append(LAG, LAG), 1.0 - PAIR), "process .* nonnegative definite"),
    "Q not symmetric": (lambda: gimc.filter_gain(gimc.append(LAG, LAG), np.triu(np.ones((2, 2)))), "symmetric"),
    "zero R": (lambda: gimc.filter_gain(LAG, ONE, [0.0]), "measurement .* positive definite"),
    "negative R": (lambda: gimc.sampled_observer(LAG, 0.1, ONE, [-1.0]), "measurement .* positive definite"),
    "shape of Q": (lambda: gimc.sampled_observer(LAG, 0.1, PAIR), r"process has shape \(2, 2\), must be \(1, 1\)"),
    "shape of S": (lambda: gimc.filter_gain(LAG, ONE, ONE, PAIR), "cross has shape"),
    "L": (lambda: gimc.lcf(LAG, [[np.nan]]), "L has entries that are not finite"),
    "eps": (lambda: gimc.isolation_filter(LAG, LAG, LAG, np.inf), "eps"),
    "shape of eps": (lambda: gimc.isolation_filter(LAG, LAG, LAG, [1.0, 2.0]), "one for each of 1 signals"),
    "order": (lambda: gimc.reduce_order(LAG, order=1.0), "order = 1.0: must be a whole number from 0 to 1"),
    "scales": (lambda: gimc.reduce_order(LAG, input_scales=[0.0]), "input_scales"),
    "care": (lambda: gimc.care(PAIR, np.eye(3), PAIR), r"G has shape \(3, 3\), must be \(2, 2\)"),
    "care nan": (lambda: gimc.care(np.nan * PAIR, PAIR, PAIR), "A: it has entries that are not finite"),
    "lft": (lambda: gimc.lft(np.eye(3), PAIR, 1, 1), r"K has shape \(2, 2\), must be \(1, 1\)"),
    "scale": (lambda: gimc.scale(PAIR, np.eye(3)), "left has shape"),
    "connect": (lambda: gimc.connect(PAIR, np.eye(3), PAIR, PAIR), "feedback has shape"),
    "frequency": (lambda: gimc.frequency_response(LAG, [np.nan]), "nan is no frequency"),
    "grid": (lambda: gimc.sweep_norm(LAG, points_per_decade=0), "points_per_decade"),
    "improper": (lambda: abcd(control.tf([1, 0, 0], [1, 1])), "not proper, with 2 zeros and 1 poles"),
    "minimal rtol": (lambda: gimc.minimal_realisation(LAG, rtol=-1.0), "rtol"),
}


@pytest.mark.parametrize("name", OPTIONS)
def test_option_out_of_range(name: str) -> None:
    call, words = OPTIONS[name]
    with pytest.raises(ValueError, match=words) as raised:
        call()
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("number", [1.0, True, "1", None, 0, 9, -1])
def test_numbers_of_signals(number: Any) -> None:
    for function in (gimc.hinfsyn, gimc.matching_lower_bound, gimc.model_matching):
        with pytest.raises(gimc.SynthesisError, match=r"nmeas = .*: must be a whole number from 1 to 4"):
            function(PLANT, number, 1)
        with pytest.raises(gimc.SynthesisError, match=r"ncon = .*: must be a whole number from 1 to 4"):
            function(PLANT, 2, number)


def test_numpy_integers_count() -> None:
    assert gimc.hinfsyn(PLANT, np.int64(2), np.int32(1))[1] == gimc.hinfsyn(PLANT, 2, 1)[1]


def test_unstable_systems_have_no_hankel_values() -> None:
    with pytest.raises(gimc.UnstableError, match="Hankel singular values need a stable system"):
        gimc.hankel_values(UNSTABLE)


def test_static_systems() -> None:
    gain = np.array([[3.0, 0.0], [0.0, 4.0]])
    assert gimc.hankel_values(gain).shape == (0,)
    assert gimc.reduce_order(gain).order == 0
    assert gimc.hinf_norm(gain)[0] == 4.0
    np.testing.assert_array_equal(gimc.minimal_realisation(gain).D, gain)
    np.testing.assert_array_equal(gimc.discretise(gain, 0.1, "tustin").D, gain)
    M, N = gimc.lcf(gain)
    np.testing.assert_array_equal(np.linalg.solve(M.D, N.D), gain)
    observer = gimc.sampled_observer(np.zeros((2, 3)), 0.1, measurement=[1.0, 2.0])
    assert observer.L.shape == (0, 2)
    np.testing.assert_array_equal(observer.covariance, np.diag([10.0, 20.0]))
    K, gamma = gimc.hinfsyn(np.array([[2.0, 1.0], [1.0, 0.0]]), 1, 1)
    assert gamma < 1e-6
    assert K.D.item() == pytest.approx(-2.0)


@pytest.mark.parametrize("pole", [20.0, 0.05, 4e5])
def test_tustin_with_its_own_pole(pole: float) -> None:
    with pytest.raises(gimc.IllPosedError, match="2/h"):
        gimc.discretise(Abcd(np.array([[pole]]), ONE, ONE, 0 * ONE), 2 / pole, "tustin")
