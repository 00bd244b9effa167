"""Fault detection at run time: innovation and residuals; what is concluded from them is said in `fdi_node.decision`.

The observer and the isolation filter are linear and run in deviations from the operating point:

    f_e = N~ u - M~ y   (M~ = (A+LC, L, C, I), N~ = (A+LC, B+LD, C, D); u with the measured air inlet temperature)
    r   = H f_e         (low-passed estimates of the faults that a filter is for)
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ac_common.arrays import Arrays, same_shape
from ac_common.compiled import ready
from ac_common.fdi_status import StatusRow, acted_on
from ac_common.products import columns_of, multiply
from ac_common.signals import Innovation
from fdi_node.compiled import Array, jit
from fdi_node.decision import Decision, JumpRule, Supervision
from fdi_node.state_machine import N_RESIDUALS, RATIOS, conclude

Vector = NDArray[np.float64]
#: A named signal, or an array of its values.
Signal = Sequence[float] | Vector


@dataclass(frozen=True)
class FdiDesign:
    """Sampled observer and isolation filter of one operating point.

    Attributes
    ----------
    a, b, c : ndarray, shapes (n, n), (n, 6), (3, n)
        Observer: inputs [compressor speed, valve, air inlet temperature, p_e, SH, T_w] in deviations; `f_e = C xi - y`.
        A row of zeros in c: this sensor is not used, and its f_e is zero.
    h_a, h_b, h_c, h_d : ndarray, shapes (m, m), (m, 3), (2, m), (2, 3)
        Isolation filter from f_e to the estimates of `ac_common.faults.ISOLABLE`: [f_N rad/s, f_p Pa].
    input_rest : ndarray, shape (3,)
        Compressor speed [rad/s], valve opening [0..1] and air inlet temperature [degC] at the operating point.
    output_rest : ndarray, shape (3,)
        Evaporator pressure [Pa], superheat [K], wall temperature [degC] there.
    thresholds : ndarray, shape (2,)
        Detection thresholds of the residuals [rad/s, Pa].
    sample_time_s : float
    supervision : Supervision
    jump_rule : JumpRule
    """

    a: Vector
    b: Vector
    c: Vector
    h_a: Vector
    h_b: Vector
    h_c: Vector
    h_d: Vector
    input_rest: Vector
    output_rest: Vector
    thresholds: Vector
    sample_time_s: float
    supervision: Supervision = field(default_factory=Supervision)
    jump_rule: JumpRule = field(default_factory=JumpRule)

    @classmethod
    def from_arrays(cls, arrays: Arrays) -> "FdiDesign":
        """Design from the arrays that the cache stores."""
        names = ("a", "b", "c", "h_a", "h_b", "h_c", "h_d", "input_rest", "output_rest", "thresholds")
        matrices: dict[str, Any] = {name: np.ascontiguousarray(arrays[name]) for name in names}
        return cls(sample_time_s=float(arrays["sample_time_s"]), **matrices)

    def try_out(self) -> None:
        """Work for one tick: matrices that do not fit show here, not when the loop runs."""
        measured = (2.5e5, 20.0, 15.0)
        detector = FaultDetector(self)
        detector.observe(0.0, measured, 30.0)
        detector.commanded((100.0, 0.4))
        detector.observe(self.sample_time_s, measured, 30.0)


class Detection(NamedTuple):
    """What the detector says at one tick.

    Attributes
    ----------
    innovation : Innovation
        f_e [Pa, K, K].
    residual : tuple of float
        Estimates of the faults of `ac_common.faults.ISOLABLE`: f_N [rad/s] and f_p [Pa].
    thresholds : tuple of float
        The residuals' detection thresholds, same units.
    detected : bool
    isolated : str or None
        The kind of fault, of two the one that was isolated last; "unknown" for one that no filter is for.
    size : float
        Estimate of the isolated fault [SI]; nan when none is isolated, or an unknown one.
    onset_s : float
        When the residual first left its threshold [s]; nan when nothing is detected.
    isolated_s : float
        When the fault was isolated [s]; nan when none is.
    also_isolated : str or None
        The fault that was isolated before, when it is still there.
    unsure : str or None
        That of both whose name may yet be the other's, so that accommodation waits.
    """

    innovation: Innovation
    residual: tuple[float, ...]
    thresholds: tuple[float, ...]
    detected: bool
    isolated: str | None
    size: float
    onset_s: float
    isolated_s: float
    also_isolated: str | None = None
    unsure: str | None = None

    @property
    def acted_on(self) -> tuple[str | None, str | None]:
        """`isolated` and `also_isolated`, None in place of one that is unsure."""
        return acted_on(self.isolated, self.also_isolated, self.unsure)

    def status(self, time_s: float) -> StatusRow:
        """Return what ``fdi/status`` says of it, at a time that counts from the first tick."""
        _, _, thresholds, detected, isolated, size, onset_s, isolated_s, *others = self
        return StatusRow(time_s, detected, isolated, size, onset_s, isolated_s, thresholds, *others)


_INPUT_SIZES = np.array([4.0, 0.01, 1.0, 1000.0, 1.0, 0.5])
"""By how much the observer's inputs may be off in a run under way: rad/s, 0..1, K, Pa, K, K."""


# Layout of what a detector remembers, and of what it is made of: inputs and outputs at the operating point, thresholds,
# then [f_e; r; eta+], [xi, u, T_ea, y, eta], xi+, and both matrices.
_REST, _THRESHOLDS, _SEEN = 0, 6, 6 + N_RESIDUALS
_N_SHOWN = 3 + N_RESIDUALS


@jit
def _observe(
    m: Array, decision: Array, n: int, k: int, time_s: float, p_e: float, superheat: float, wall: float, air_c: float
) -> int:
    """One tick of an observer with n states and a filter with k; returns as `fdi_node.state_machine.conclude`."""
    size, first = _N_SHOWN + k, _SEEN + _N_SHOWN + k
    end = first + n + 6 + k
    seen, known, matrix = m[_SEEN:first], m[first:end], end + n
    known[n + 2], known[n + 3] = air_c - m[_REST + 2], p_e - m[_REST + 3]
    known[n + 4], known[n + 5] = superheat - m[_REST + 4], wall - m[_REST + 5]
    multiply(m[matrix : matrix + size * (n + 6 + k)], known, seen)
    for i in range(k):
        known[n + 6 + i] = seen[_N_SHOWN + i]
    for i in range(N_RESIDUALS):
        decision[RATIOS + i] = abs(seen[3 + i]) / m[_THRESHOLDS + i]
    return conclude(decision, time_s, p_e, superheat, wall)


@jit
def _advance(m: Array, n: int, k: int, speed: float, valve: float) -> None:
    """Let the observer move on to the next tick with the command that was sent."""
    first = _SEEN + _N_SHOWN + k
    end = first + n + 6 + k
    known, after, matrix = m[first : first + n + 6], m[end : end + n], end + n + (_N_SHOWN + k) * (n + 6 + k)
    known[n], known[n + 1] = speed - m[_REST], valve - m[_REST + 1]
    multiply(m[matrix : matrix + n * (n + 6)], known, after)
    for i in range(n):
        known[i] = after[i]


class FaultDetector:
    """State of the observer, the isolation filter and the decision.

    Observer and filter are two matrix products a tick on one vector `[xi, u, T_ea, y, eta]`:

        [f_e; r; eta+] = M [xi, u, T_ea, y, eta]     (`observe`)
        xi+            = N [xi, u, T_ea, y]          (`commanded`)
    """

    def __init__(self, design: FdiDesign) -> None:
        self.design = design
        self._observe, self._advance = ready(_observe), ready(_advance)
        n, k = self._sizes = len(design.a), len(design.h_a)
        self._used = np.diag(design.c.any(axis=1).astype(np.float64))  # of the sensors
        to_innovation = np.hstack([design.c, np.zeros((3, 3)), -self._used])  # of [xi, u, T_ea, y]
        through = np.vstack([np.eye(3), design.h_d, design.h_b])
        own = np.vstack([np.zeros((3, k)), design.h_c, design.h_a])
        observe, advance = np.hstack([through @ to_innovation, own]), np.hstack([design.a, design.b])
        constants = [design.input_rest, design.output_rest, design.thresholds]
        vectors = np.zeros(_N_SHOWN + k + n + 6 + k + n)
        self._memory = np.concatenate([*constants, vectors, columns_of(observe), columns_of(advance)])
        first = _SEEN + _N_SHOWN + k
        self._shown, self._in = self._memory[_SEEN : _SEEN + _N_SHOWN], self._memory[first : first + n + 6 + k]
        self._observer, self._filter = self._in[:n], self._in[n + 6 :]
        self._thresholds: tuple[float, ...] = tuple(design.thresholds.tolist())
        used = design.c.any(axis=1).tolist()
        self._decision = Decision(design.supervision, _jumps_of(design.jump_rule, used), design.sample_time_s)

    def state(self) -> dict[str, Any]:
        """Return what a detector that takes this one's place needs, fit for JSON (nan, inf); between two ticks."""
        return {"_in": self._in.tolist(), "decision": self._decision.state()}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take the place of the detector whose `state` this is.

        Raises
        ------
        ValueError
            When it is none of a detector of this design.
        """
        try:
            signals = same_shape(state["_in"], self._in)
            self._decision.restore(state["decision"])
        except (KeyError, TypeError, ValueError) as problem:
            msg = f"not the state of such a detector: {type(problem).__name__} {problem}"
            raise ValueError(msg) from None
        self._in[:] = signals

    def warm_restart(
        self,
        measured: Signal,
        air_inlet_temperature_c: float,
        command: Signal,
        missed_ticks: int | None = None,
    ) -> None:
        """Go over ticks that were missed, as if all signals had moved from the last ones to these in straight lines.

        Call it before `observe`, with that tick's measurements and the command before. The decision stands still.

        When it is not known what was before, it begins with no innovation: of the states that explain the measurements
        it takes the one nearest to rest, by the covariance that the observer's inputs give them. So a transient is not
        taken for a fault, and a fault looks as if it began now.

        Parameters
        ----------
        measured : sequence of float, length 3
            Evaporator pressure [Pa], superheat [K], wall temperature [degC].
        air_inlet_temperature_c : float
        command : sequence of float, length 2
            Compressor speed [rad/s], valve opening [0..1].
        missed_ticks : int, optional
            How many; None: what was before is not known.
        """
        self._decision.forget_jumps()
        if missed_ticks is None:
            self._begin_from_rest(measured, air_inlet_temperature_c, command)
            return
        design = self.design
        n = len(design.a)
        start, end = self._in[n : n + 6].copy(), self._now(measured, air_inlet_temperature_c, command)
        for tick in range(1, missed_ticks + 1):
            inputs = start + (end - start) * (tick / (missed_ticks + 1))
            innovation = design.c @ self._observer - self._used @ inputs[3:]
            self._filter[:] = design.h_a @ self._filter + design.h_b @ innovation
            self._observer[:] = design.a @ self._observer + design.b @ inputs

    def _begin_from_rest(self, measured: Signal, air_inlet_temperature_c: float, command: Signal) -> None:
        design = self.design
        inputs = self._now(measured, air_inlet_temperature_c, command)
        rest = np.linalg.solve(np.eye(len(design.a)) - design.a, design.b @ inputs)
        driven = design.b * _INPUT_SIZES
        covariance = _covariance(design.a, driven @ driven.T)
        towards, unexplained = covariance @ design.c.T, self._used @ inputs[3:] - design.c @ rest
        # Least squares: a sensor that is not used explains nothing, nor do two that see the same.
        self._observer[:] = rest + towards @ np.linalg.lstsq(design.c @ towards, unexplained, rcond=None)[0]
        self._filter[:] = 0.0

    def _now(self, measured: Signal, air_inlet_temperature_c: float, command: Signal) -> Vector:
        """Return the observer's inputs, in deviations."""
        actual = np.concatenate([command, [air_inlet_temperature_c], measured])
        now: Vector = actual - np.concatenate([self.design.input_rest, self.design.output_rest])
        return now

    def observe(self, time_s: float, measured: Signal, air_inlet_temperature_c: float) -> Detection:
        """Return innovation, residuals and decision of this tick.

        Parameters
        ----------
        time_s : float
            Time of the tick.
        measured : sequence of float, length 3
            Evaporator pressure [Pa], superheat [K], wall temperature [degC].
        air_inlet_temperature_c : float
        """
        n, k = self._sizes
        p_e, superheat, wall = measured
        changes = self._observe(
            self._memory, self._decision.memory, n, k, time_s, p_e, superheat, wall, air_inlet_temperature_c
        )
        seen = self._shown.tolist()
        residual = tuple(seen[3:])
        detected, isolated, number, onset_s, isolated_s, also = self._decision.concluded(changes)
        size = residual[number] if number >= 0 else math.nan
        innovation = Innovation(*seen[:3])
        return Detection(innovation, residual, self._thresholds, detected, isolated, size, onset_s, isolated_s, also)

    def commanded(self, command: Signal) -> None:
        """Close the tick with the command [rad/s, 0..1] that the controller has sent.

        Must be called once after each `observe`: the observer moves on to the next tick here.
        """
        self._advance(self._memory, *self._sizes, *command)


def _jumps_of(rule: JumpRule, used: Sequence[bool]) -> JumpRule:
    """Return the rule without the readings that a design does not use."""

    def only(limits: tuple[float, float, float]) -> tuple[float, float, float]:
        first, second, third = (limit if is_used else math.inf for limit, is_used in zip(limits, used, strict=True))
        return first, second, third

    return replace(rule, smallest=only(rule.smallest), still=only(rule.still))


def _covariance(A: Vector, W: Vector) -> Vector:
    """Return the solution of `P = A P A' + W`: SciPy's takes longer to load than this takes for a dozen states."""
    n = len(A)
    P: Vector = np.linalg.solve(np.eye(n * n) - np.kron(A, A), W.ravel()).reshape(n, n)
    return P
