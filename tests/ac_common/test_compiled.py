"""Compiled functions that only borrow arrays count no references; those that make some do, and nothing leaks."""

import gc
import subprocess
import sys
import weakref
from typing import NamedTuple

import numpy as np
import pytest
from numba.core.errors import NumbaError

from ac_common.compiled import Array, _counts_references, compiler
from ac_experiments.compiled_loop import CompiledLoop
from ac_experiments.designs import designs_of
from ac_experiments.scenario import load

jit = compiler("ac_common.compiled")


class Pair(NamedTuple):
    one: Array
    other: Array


@jit
def halves(both: Array) -> Pair:
    return Pair(both[:2], both[2:])


@jit
def difference(pair: Pair) -> float:
    row = pair.one[1:]
    return row[0] - pair.other[1]


@jit
def of_halves(both: Array) -> float:
    return difference(halves(both))


@jit
def reversed_difference(pair: Pair) -> float:
    turned = np.empty(2)
    for i in range(2):
        turned[i] = pair.one[1 - i]
    return difference(Pair(turned, pair.other))


@jit
def unseen(pair: Pair) -> float:
    return difference(Pair(pair.one + pair.other, pair.other))


def test_who_makes_or_is_given_arrays_counts_references():
    counting = {
        one.__name__
        for one in (halves, difference, of_halves, reversed_difference, unseen)
        if _counts_references(one.py_func)
    }
    assert counting == {"halves", "of_halves", "reversed_difference"}


def test_all_of_them_call_each_other_and_leave_arrays_as_they_were():
    both = np.arange(4.0)
    pair = Pair(both[:2], both[2:])
    before = [sys.getrefcount(array) for array in (both, *pair)]
    for _ in range(100):
        assert (of_halves(both), difference(pair), reversed_difference(pair)) == (-2.0, -2.0, -3.0)
    assert [sys.getrefcount(array) for array in (both, *pair)] == before


def test_an_array_that_is_made_unseen_is_an_error_when_compiled():
    with pytest.raises((NumbaError, NotImplementedError), match=r"(?i)nrt"):
        unseen(Pair(np.zeros(2), np.zeros(2)))


def test_a_run_leaves_no_array_behind():
    scenario = load("drive:0", ["duration_s=20"])
    loop = CompiledLoop(scenario, designs_of(scenario), None, accommodate=True)
    assert loop.run_compiled(lambda *_: None)
    left = [weakref.ref(array) for array in (loop.made, loop._observer._flat, loop._plant._array, loop._air)]
    del loop
    gc.collect()
    assert [reference() for reference in left] == [None] * len(left)


def test_compiled_code_loads_no_linear_algebra_and_leaves_it_to_others():
    program = """
import sys
from ac_plant_node import Plant
Plant.at("med").advance(1.0)
print("scipy.linalg" in sys.modules)
import scipy.linalg.cython_blas
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == "False\n"
