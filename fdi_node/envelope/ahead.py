"""Compiles the observer in an order that lets another process compile the plant meanwhile.

What one has compiled is in the cache for the other. So what has nothing of the plant's equations in it comes first, and
by the time that the rest is due much of the plant is there.
"""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numba import typeof

from ac_common.cache import compiled_folder
from ac_plant_node.dynamics.balances import N_STATES
from ac_plant_node.dynamics.workspace import views
from fdi_node.envelope import filter as kalman
from fdi_node.envelope import jumps
from fdi_node.envelope.compiled import SOURCES
from fdi_node.envelope.detector import EnvelopeDesign
from fdi_node.envelope.memory import N_PARAMETERS, Rules, memory_of, new_memory, packed, rules_in
from fdi_node.envelope.model import N_READINGS
from fdi_node.envelope.quiet import is_quiet
from fdi_node.envelope.transition import hold, transition


def is_compiled() -> bool:
    """Return whether `compile_rest` has been here."""
    return _mark().exists()


def compile_first() -> None:
    """Compile what has nothing of the plant's equations in it."""
    for function, arguments in parts():
        function.compile(tuple(typeof(argument) for argument in arguments))


def compile_rest(design: EnvelopeDesign) -> None:
    """Compile the rest, by two ticks of any design."""
    design.try_out()
    with contextlib.suppress(OSError):  # a cache that cannot be written costs time, and nothing else
        _mark().touch()


def parts() -> Iterator[tuple[Any, tuple[Any, ...]]]:
    """Give the functions that come first, each with arguments of the types that it is compiled for."""
    size = np.zeros(1)
    noise, readings, parameters = np.zeros(N_STATES + 1), np.zeros(N_READINGS), np.zeros(N_PARAMETERS)
    empty = Rules(np.zeros((1, 5)), noise, readings, size, size, size, size, parameters, size)
    flat, design = new_memory(1, 1), packed(empty)
    m, rules = memory_of(flat, 1, 1), rules_in(design)
    k = views(m.work)
    yield kalman.accept_jump, (flat, rules, 0, False)
    yield kalman.accept_reading_jump, (flat, rules, 0)
    yield kalman.settle, (flat, rules, 0, 0.0)
    yield is_quiet, (flat, design, size, size)
    yield jumps.begin_due, (m, rules, 0)
    yield kalman.innovate, (m, rules, size)
    yield kalman.correct, (m, rules)
    yield jumps.judge, (m, rules)
    yield jumps.propagate, (m, rules, 0.0)
    yield kalman.propagate_covariance, (m, size, rules, 0)
    yield transition, (k, m.A, 0.0, m.F)
    yield hold, (m.F,)


def _mark() -> Path:
    return compiled_folder(*SOURCES) / "complete"
