"""The compensator at run time: `q = Q f_e`, with the Q that the isolation calls for.

A Q for both faults at once, the guard, acts all the time: plant outputs move within tenths of a second of a fault,
sooner than anything can be isolated, and a second fault may come any time. Q_act or Q_sen, each for its own fault
alone, has the say at rest as soon as that fault is isolated:

    q = Q_both f_e + LP (Q_i f_e - Q_both f_e)     LP: a low-pass, at rest while nothing or both are isolated

Let in at once, Q_act would take a second fault, of the pressure reading, for one of its own, and move the pressure by
more than that fault's size before it can be isolated.

After a manoeuvre the linear observer is off by what the plant is not linear, and all filters take that for small
faults. So what each gives at rest is forgotten slowly while no fault is isolated; what was forgotten is held while one
is.

Both low-passes are of second order: what a fault brings in before it is isolated, some seconds, is next to nothing.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ac_common.arrays import Arrays, same_shape
from ac_common.compiled import ready
from ac_common.faults import ISOLABLE_KINDS, UNKNOWN
from ac_common.products import columns_of, multiply
from ac_common.units import KPA, RPM
from gimc_controller_node.authority import DESIGN_RANGE, GAIN, N_AUTHORITY, Authority, let_through
from gimc_controller_node.command_limits import CommandLimits
from gimc_controller_node.compiled import Array, jit
from gimc_controller_node.reach import N_REACH, REACH_GAIN, Reach, approach

Vector = NDArray[np.float64]
#: A named signal, or an array of its values.
Signal = Sequence[float] | Vector

ANY_COMMAND = np.array(CommandLimits().high) * np.array([RPM, 0.01])
"""From one end of the commands to the other [rad/s, 0..1]: a bound of q that is as good as none."""

TYPICAL_STEPS = np.diag([5.0 * KPA, 0.3, 0.1])
"""Steps of f_e [Pa, K, K], each by itself: what q is bounded by when a design does not say it."""

TYPICAL_LENGTH_S = 20.0
"""How long the filters' answer to them is looked at: what q does at rest is Q's to say, not the bound's."""


def range_of_filters(design: "CompensatorDesign") -> Vector:
    """Return bounds of q for a design that comes without: from how its own filters answer `TYPICAL_STEPS`.

    Returns
    -------
    ndarray, shape (2,)
        `DESIGN_RANGE` times the largest peak of q [rad/s, 0..1] of its three filters; at most `ANY_COMMAND`, at least a
        thousandth of it.
    """
    a, c, d = design.a, design.c, design.d
    state, peaks, inputs = np.zeros((len(a), 3)), np.zeros(6), design.b @ TYPICAL_STEPS
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(round(TYPICAL_LENGTH_S / design.sample_time_s)):
            np.maximum(peaks, np.abs(c @ state + d @ TYPICAL_STEPS).max(axis=1), out=peaks)
            state = a @ state + inputs
    largest = np.nan_to_num(DESIGN_RANGE * peaks.reshape(3, 2).max(axis=0), nan=np.inf)
    return np.asarray(np.clip(largest, 1e-3 * ANY_COMMAND, ANY_COMMAND))


OFTEN, OFTEN_S, SELDOM = 2.0, 600.0, 0.5
"""Faults isolated anew, each counting for this time constant, from which isolation is not followed, and below which it
is again once nothing is isolated.

Far from the operating point what the plant is not linear can look like a fault, Q_i then move the plant to where it
does not, and let go: a cycle of minutes. A real fault that comes and goes as often is left to the guard.
"""

OUTSIDE = "outside the design range: K0 alone"


@dataclass(frozen=True)
class CompensatorDesign:
    """Sampled guard, Q_act and Q_sen side by side: one block-diagonal filter from f_e to the three q's.

    Attributes
    ----------
    a : ndarray, shape (n, n)
    b : ndarray, shape (n, 3)
        Input f_e [Pa, K, K].
    c : ndarray, shape (6, n)
        Rows 0-1: q of the guard, rows 2-3: of Q_act, rows 4-5: of Q_sen [rad/s, 0..1].
    d : ndarray, shape (6, 3)
    handover_time_s : float
        Time constants with which Q_act or Q_sen takes over from the guard.
    fade_time_s : float
        Time constant with which it goes out again; and how long, in a straight line, all of q takes to fade out or in
        when accommodation is switched or q leaves its bounds.
    washout_time_s : float
        Time constants with which what is there at rest is forgotten.
    sample_time_s : float
    q_range : ndarray, shape (2,)
        What q is bounded by [rad/s, 0..1] (see `gimc_controller_node.authority`); left empty, `range_of_filters`.
    reference_rest, reach_offsets, reach_excess : ndarray, shapes (2,), (2, m), (2, m)
        How q is scaled where the references lead elsewhere (see `gimc_controller_node.reach`); left empty, it is not.
    """

    a: Vector
    b: Vector
    c: Vector
    d: Vector
    handover_time_s: float
    fade_time_s: float
    washout_time_s: float
    sample_time_s: float
    q_range: Vector = field(default_factory=lambda: np.empty(0))
    reference_rest: Vector = field(default_factory=lambda: np.empty(0))
    reach_offsets: Vector = field(default_factory=lambda: np.empty((2, 0)))
    reach_excess: Vector = field(default_factory=lambda: np.empty((2, 0)))

    def __post_init__(self) -> None:
        """Find the bounds of q when there are none."""
        if not self.q_range.size:
            object.__setattr__(self, "q_range", range_of_filters(self))

    @classmethod
    def from_arrays(cls, arrays: Arrays) -> "CompensatorDesign":
        """Return the design from the arrays of a file, which may lack the last four."""
        none = np.empty((2, 0))
        free = {"q_range": np.empty(0), "reference_rest": np.empty(0), "reach_offsets": none, "reach_excess": none}
        known = {**free, **arrays}
        matrices = {name: np.ascontiguousarray(known[name]) for name in ("a", "b", "c", "d", *free)}
        names = ("handover_time_s", "fade_time_s", "washout_time_s", "sample_time_s")
        return cls(**matrices, **{name: float(arrays[name]) for name in names})  # type: ignore[arg-type]

    def try_out(self) -> None:
        """Work for one tick: matrices that do not fit show here, not when the loop runs."""
        Compensator(self).step(np.array([1e3, 1.0, 1.0]), None, None, reference=(2.5e5, 20.0))


# Layout of what a `Compensator` remembers, and of what it is made of; behind it stand the vectors and both matrices.
_SHARE, _OFTEN, _FOLLOWS, _ISOLATED, _Q_SPEED, _Q_VALVE = range(6)
_HANDS_OVER, _FADES, _SHARE_STEP, _FORGETS_OFTEN = range(6, 10)
_CORRECTION = 10  # first lag, then second one
_AUTHORITY = _CORRECTION + 4
_REACH = _AUTHORITY + N_AUTHORITY
_VECTORS = _REACH + N_REACH

_NOBODY, _STRANGER = -1, len(ISOLABLE_KINDS)
_NUMBER: dict[str | None, int] = {None: _NOBODY, UNKNOWN: _STRANGER}
_NUMBER |= {kind: i for i, kind in enumerate(ISOLABLE_KINDS)}


@jit
def _may_follow(m: Array, isolated: float) -> bool:
    """Return whether the faults that are isolated, none to two, are to be followed.

    Not when they come and go too often, nor where q has gone beyond its bounds or all of it would leave too little
    margin: a model that is not good enough for the guard is not for the isolation either.
    """
    m[_OFTEN] = m[_OFTEN] * m[_FORGETS_OFTEN] + (1.0 if isolated > m[_ISOLATED] else 0.0)
    m[_ISOLATED] = isolated
    if m[_OFTEN] > OFTEN:
        m[_FOLLOWS] = 0.0
    elif m[_OFTEN] < SELDOM and isolated == 0.0:
        m[_FOLLOWS] = 1.0
    on_probation, is_whole = m[_AUTHORITY + GAIN] < 1.0, m[_REACH + REACH_GAIN] > 1.0 - 1e-9
    return m[_FOLLOWS] != 0.0 and not on_probation and is_whole


@jit
def _filtered(m: Array, n: int, forgets: bool, p_e: float, superheat: float, wall: float) -> Array:
    """Let the filters take f_e; return what is kept of their signals, (6,)."""
    end = _VECTORS + n + 15
    known, kept, size = m[_VECTORS:end], m[end : end + n + 18], (n + 15) * (n + 18)
    known[n + 12], known[n + 13], known[n + 14] = p_e, superheat, wall
    first = end + n + 18 + (0 if forgets else size)
    multiply(m[first : first + size], known, kept)
    for i in range(n + 12):
        known[i] = kept[6 + i]
    return kept[:6]


@jit
def _compensate(
    m: Array, n: int, p_e: float, superheat: float, wall: float, isolated: int, also: int, acts: int, aims: int
) -> None:
    """One tick with f_e: see `Compensator.step`; `isolated`, `also`: by `_NUMBER`; `aims`: references are known."""
    stands_back = isolated == _STRANGER
    if stands_back:
        isolated = also = _NOBODY
    if not _may_follow(m, float((isolated != _NOBODY) + (also != _NOBODY))):
        isolated = also = _NOBODY
    kept = _filtered(m, n, isolated == _NOBODY, p_e, superheat, wall)
    correction = m[_CORRECTION : _CORRECTION + 4]
    if isolated == _NOBODY or also != _NOBODY:
        for i in range(4):
            correction[i] *= m[_FADES]
    else:
        row, rate = 2 + 2 * isolated, m[_HANDS_OVER]
        correction[0] += rate * (kept[row] - kept[0] - correction[0])
        correction[1] += rate * (kept[row + 1] - kept[1] - correction[1])
        correction[2] += rate * (correction[0] - correction[2])
        correction[3] += rate * (correction[1] - correction[3])
    change = m[_SHARE_STEP] if acts != 0 and not stands_back else -m[_SHARE_STEP]
    m[_SHARE] = min(max(m[_SHARE] + change, 0.0), 1.0)
    if aims != 0:
        approach(m[_REACH:_VECTORS])
    gain = m[_REACH + REACH_GAIN]
    speed, valve = gain * (kept[0] + correction[2]), gain * (kept[1] + correction[3])
    share = m[_SHARE] * let_through(m[_AUTHORITY:_REACH], speed, valve)
    m[_Q_SPEED] = m[_Q_VALVE] = 0.0
    if share != 0.0:
        m[_Q_SPEED], m[_Q_VALVE] = share * speed, share * valve


class Compensator:
    """The filters' state, the fade, and the step.

    Parameters
    ----------
    design : CompensatorDesign
    accommodate : bool
        False leaves K0 alone (`q = 0`), for the passive runs. May be changed between two steps: the filters run on
        either way, and `q` goes to nothing, or comes back, in a straight line over the design's `fade_time_s`.
    """

    def __init__(self, design: CompensatorDesign, accommodate: bool = True) -> None:
        self.design = design
        self.accommodate = accommodate
        self._compensate = ready(_compensate)
        n = self._n = len(design.a)
        times = (design.handover_time_s, design.fade_time_s, design.washout_time_s)
        hands_over, fades, forgets = (-math.expm1(-design.sample_time_s / time) for time in times)
        matrices = [columns_of(_filters(design, rate)) for rate in (forgets, 0.0)]
        m = self._memory = np.concatenate([np.zeros(_VECTORS + 2 * n + 33), *matrices])
        m[_SHARE], m[_FOLLOWS] = float(accommodate), 1.0  # the share is that of q which is let through
        m[_HANDS_OVER], m[_FADES] = hands_over, 1.0 - fades
        m[_SHARE_STEP] = design.sample_time_s / design.fade_time_s
        m[_FORGETS_OFTEN] = math.exp(-design.sample_time_s / OFTEN_S)
        self._q, self._correction = m[_Q_SPEED : _Q_VALVE + 1], m[_CORRECTION:_AUTHORITY]
        vectors = np.split(m[_VECTORS : _VECTORS + n + 15], [n, n + 6, n + 12])
        self._vectors = dict(zip(("_state", "_first_lag", "_forgotten", "_innovation"), vectors, strict=True))
        sample_time_s, fade_time_s = design.sample_time_s, design.fade_time_s
        reach = design.reference_rest, design.reach_offsets, design.reach_excess
        self._reach = Reach(*reach, sample_time_s, fade_time_s, m[_REACH:_VECTORS])
        self._authority = Authority(design.q_range, sample_time_s, fade_time_s, m[_AUTHORITY:_REACH])

    @property
    def does(self) -> str:
        """`OUTSIDE` while q is kept out because it would be more than the designs are for, otherwise empty.

        Empty, too, while nothing is to be accommodated: then q is out anyway.
        """
        return OUTSIDE if self._authority.outside and self.accommodate else ""

    def state(self) -> dict[str, Any]:
        """Return what a compensator that takes this one's place has to know, fit for JSON; between two ticks."""
        m = self._memory
        return {
            **{name: vector.tolist() for name, vector in self._vectors.items()},
            "_correction": self._correction.tolist(),
            "_share": float(m[_SHARE]),
            "_often": float(m[_OFTEN]),
            "_follows": bool(m[_FOLLOWS]),
            "_isolated": int(m[_ISOLATED]),
            "_reach": self._reach.gain,
            "_authority": self._authority.state(),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take the place of the compensator whose `state` this is.

        Raises
        ------
        ValueError
            When it is none of a compensator of this design.
        """
        try:
            arrays = {name: same_shape(state[name], vector) for name, vector in self._vectors.items()}
            correction = same_shape(state["_correction"], self._correction)
            share, often = float(state["_share"]), float(state["_often"])
            follows, isolated, reach = bool(state["_follows"]), int(state["_isolated"]), float(state["_reach"])
            self._authority.restore([float(value) for value in state["_authority"]])
        except (KeyError, TypeError, ValueError) as problem:
            msg = f"not the state of such a compensator: {type(problem).__name__} {problem}"
            raise ValueError(msg) from None
        for name, array in arrays.items():
            self._vectors[name][:] = array
        self._correction[:] = correction
        m = self._memory
        m[_SHARE], m[_OFTEN], m[_FOLLOWS], m[_ISOLATED] = share, often, follows, isolated
        self._reach.restore(reach)

    def warm_restart(
        self,
        innovation: Signal,
        isolated: str | None,
        also_isolated: str | None,
        reference: Signal | None,
        missed_ticks: int,
    ) -> None:
        """Go over missed ticks as if f_e had moved from the last one to this one in a straight line.

        Call it before `step`, with that tick's innovation, isolation and references.
        """
        start, end = self._vectors["_innovation"].copy(), np.array(innovation)
        for tick in range(1, missed_ticks + 1):
            self.step(start + (end - start) * (tick / (missed_ticks + 1)), isolated, also_isolated, reference)

    def step(
        self,
        innovation: Signal,
        isolated: str | None,
        also_isolated: str | None = None,
        reference: Signal | None = None,
        measured: Signal | None = None,  # noqa: ARG002
        is_unsure: bool = False,  # noqa: ARG002
    ) -> Vector:
        """Return the signal q of this tick.

        Parameters
        ----------
        innovation : ndarray, shape (3,)
            f_e [Pa, K, K].
        isolated : str or None
            The isolated fault: a kind that has a filter, "unknown", or None. While it is unknown, q goes to nothing as
            when accommodation is switched off: f_e then says nothing that a Q could make use of.
        also_isolated : str or None
            The other one, when both are.
        reference : sequence of float, length 2, optional
            References of p_e [Pa] and SH [K]; None: those of the tick before still hold.
        measured
            Not used.

        Returns
        -------
        ndarray, shape (2,)
            q [rad/s, 0..1].
        """
        if reference is not None:
            self._reach.aim(*reference)
        p_e, superheat, wall = innovation
        numbers = _NUMBER[isolated], _NUMBER[also_isolated], int(self.accommodate), int(reference is not None)
        self._compensate(self._memory, self._n, float(p_e), float(superheat), float(wall), *numbers)
        return self._q.copy()

    def commanded(self, command: Signal) -> None:
        """Do nothing: this compensator has no use for the command."""


def _filters(design: CompensatorDesign, rate: float) -> Vector:
    """Return the matrix of a tick: `[what is kept of the six signals, x+, l+, g+]` of `[x, l, g, f_e]`.

    x is the filters' state and `s = C x + D f_e` the signals. What is kept of them is `s - g`; g, what is forgotten, is
    s after two lags: `l+ = l + rate (s - l)`, `g+ = g + rate (l+ - g)`.
    """
    n, one, none = len(design.a), np.eye(6), np.zeros((6, 6))
    signals = np.hstack([design.c, none, none, design.d])
    first, second = (np.hstack([np.zeros((6, n)), *parts, np.zeros((6, 3))]) for parts in ((one, none), (none, one)))
    first_next = first + rate * (signals - first)
    states = np.hstack([design.a, np.zeros((n, 12)), design.b])
    return np.vstack([signals - second, states, first_next, second + rate * (first_next - second)])
