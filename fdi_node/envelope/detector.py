"""Fault detection over the whole envelope: the design, and observer and decision at run time.

The innovation ``f_e`` is that of the nonlinear plant (`fdi_node.envelope.filter`), so it stands for the plant's left
coprime factors along the trajectory, a nonlinear kernel representation: with no fault and no error of the model it is
white noise whatever the load. The residual is ``r = H f_e`` with a time-varying H: the filter's own estimates of the
faults. In the two-stage form of Friedland (IEEE TAC 14(4), 1969, 359) that is a filter without faults, whose innovation
is f_e, followed by one of the faults that is driven by f_e alone; both forms give the same estimates, and this one is
computed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ac_common.arrays import Arrays, same_shape
from ac_common.compiled import ready
from ac_common.signals import Innovation
from ac_plant_node.dynamics import integrator
from ac_plant_node.dynamics.balances import N_STATES
from ac_plant_node.dynamics.drive import AIR_C, OPENING, SPEED
from ac_plant_node.inputs import INPUT, N_HELD, N_INPUTS
from ac_plant_node.properties.tables import REFRIGERANTS, load_tables
from ac_plant_node.saturation import saturation_curve
from fdi_node.detector import Detection
from fdi_node.envelope import filter as kalman
from fdi_node.envelope.afresh import Afresh
from fdi_node.envelope.decision import Conclusion, EnvelopeDecision
from fdi_node.envelope.jumps import LARGEST_JUMP
from fdi_node.envelope.limits import Limits
from fdi_node.envelope.memory import (
    NIS,
    Memory,
    Rules,
    memory_of,
    new_memory,
    packed,
    remembered,
    rules_in,
)
from fdi_node.envelope.model import ENERGY, N_READINGS, READING_SCALE, STATE_SCALE
from fdi_node.envelope.outlet import take_outlet_temperature
from fdi_node.envelope.rival import Rival
from fdi_node.envelope.unknowns import PARAMETERS, UNKNOWNS, Unknown, table

Vector = NDArray[np.float64]
#: A named signal, or an array of its values.
Signal = Sequence[float] | Vector

_AIR, _CONDENSER_AIR_C = INPUT["air_mass_flow"], INPUT["condenser_air_inlet_temperature"]
JACOBIAN_S = 2.0
"""A Jacobian is renewed after this time at the latest, or after twice of it where it is good."""
_NEAR, _FAR = 0.05, 0.5
"""Standard deviations of the states, in units of their scales, where the observer begins: at a known rest, anywhere."""


@dataclass(frozen=True)
class EnvelopeDesign:
    """Observer and decision for all loads.

    Attributes
    ----------
    parameters : ndarray, shape (28,)
        The plant's, as `ac_plant_node.parameters.values.Parameters.array`.
    refrigerant : float
        Position in `ac_plant_node.properties.tables.REFRIGERANTS`.
    start_states, start_inputs, start_outputs : ndarray, shapes (k, 12), (k, 7), (k, 4)
        States at rest (of the integration) that the observer may begin at, with inputs and outputs there.
    used : ndarray, shape (4,)
        1 for each reading of p_e, SH, T_w, p_c that is used, 0 for the others.
    reading_std : ndarray, shape (4,)
        Standard deviations of the readings' noise [Pa, K, K, Pa].
    state_noise : ndarray, shape (12,)
        Intensities of the process noise of the integration vector, per sqrt(s).
    rate_share : float
        By what share of its own rate a state may go elsewhere, for about a second.
    first, drift : ndarray, shape (m,)
        Of the unknowns, as `fdi_node.envelope.unknowns.Unknown`; m is the length of `UNKNOWNS`, or with the plant's
        parameters that may be off that of `UNKNOWNS + PARAMETERS`. A first and a drift of 0: known.
    opened : float
        1: parameters that may be off are estimated from the start; 0: when the plant turns out to be another one.
    derived : float
        Whether the superheat is derived from the measured pressure: 1 or 0.
    blower : float
        Whether the observer is told the air flow through the evaporator: 1 or 0.
    limits : ndarray
        The numbers of `fdi_node.envelope.limits.Limits`, in their order.
    sample_time_s : float
    """

    parameters: Vector
    refrigerant: float
    start_states: Vector
    start_inputs: Vector
    start_outputs: Vector
    used: Vector
    reading_std: Vector
    state_noise: Vector
    rate_share: float
    first: Vector
    drift: Vector
    opened: float
    derived: float
    blower: float
    limits: Vector
    sample_time_s: float

    @classmethod
    def from_arrays(cls, arrays: Arrays) -> "EnvelopeDesign":
        """Return the design from the arrays that the cache stores."""
        scalars = ("refrigerant", "rate_share", "opened", "derived", "blower", "sample_time_s")
        values: dict[str, Any] = {name: np.ascontiguousarray(arrays[name]) for name in cls.__dataclass_fields__}
        return cls(**values | {name: float(arrays[name]) for name in scalars})

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """Return the rows of what is estimated beside the plant's states."""
        return (UNKNOWNS + PARAMETERS)[: len(self.first)]

    def try_out(self) -> None:
        """Work for two ticks: arrays that do not fit show here, not when the loop runs."""
        detector = EnvelopeDetector(self)
        at, inputs = self.start_outputs[0], self.start_inputs[0]
        for tick in range(2):
            air = (float(inputs[AIR_C]), float(inputs[_CONDENSER_AIR_C]), float(inputs[_AIR]))
            detector.observe(tick * self.sample_time_s, at, *air)
            detector.commanded(inputs[:2])


def rules_of(design: EnvelopeDesign) -> Rules:
    """Return what the compiled filter needs of a design."""
    rows = table(design.unknowns)
    scales = np.concatenate([STATE_SCALE, rows[:, 2]])
    jumps = [(i, one.jump) for i, one in enumerate(design.unknowns) if one.reported]
    rates = [(i, one.rate) for i, one in enumerate(design.unknowns) if one.rate > 0.0]
    jumping = [i for i, _ in jumps + rates]
    sizes = np.array([size for _, size in jumps + rates]) / rows[jumping, 2]
    return Rules(
        rows=rows,
        Q=(np.concatenate([design.state_noise, design.drift]) / scales) ** 2,
        R=np.where(design.used > 0.5, (design.reading_std / READING_SCALE) ** 2, np.inf),
        jumping=np.array(jumping, dtype=np.float64),
        prior=np.where(sizes > 0.0, 1.0 / np.maximum(sizes, 1.0e-9) ** 2, -1.0),
        most=np.where(sizes > 0.0, LARGEST_JUMP * sizes, np.inf),
        growing=np.repeat([0.0, 1.0], [len(jumps), len(rates)]),
        nominal=np.ascontiguousarray(design.parameters),
        constants=np.array([design.sample_time_s, round(JACOBIAN_S / design.sample_time_s), design.rate_share]),
    )


class EnvelopeDetector:
    """The observer, the residuals and the decision at run time.

    It has the methods of `fdi_node.detector.FaultDetector`; `observe` is told the temperature of the condenser's air,
    too.

    Attributes
    ----------
    memory : Memory
    rules : Rules
    curve : ndarray
        As of `take_outlet_temperature`, empty where the superheat is not derived.
    """

    def __init__(self, design: EnvelopeDesign) -> None:
        self.design = design
        self._packed = packed(rules_of(design))
        self.rules = rules_in(self._packed)
        self._tab = load_tables(REFRIGERANTS[int(design.refrigerant)])
        m, q = len(design.first), len(self.rules.jumping)
        self._flat, self._remembered = new_memory(m, q), remembered(m, q)
        self.memory: Memory = memory_of(self._flat, m, q)
        self._told, self._reading = np.zeros(N_HELD), np.zeros(N_READINGS)
        self._begun = False
        self.curve = saturation_curve() if design.derived > 0.5 else np.empty(0)
        self._take_outlet_temperature = ready(take_outlet_temperature)
        self._afresh: Afresh | None = None
        limits, is_open = Limits(*design.limits.tolist()), design.opened > 0.5
        self._decision = EnvelopeDecision(limits, design.unknowns, self._flat, self._packed, is_open)
        self._shown = (-READING_SCALE * design.used).tolist()

    def _begin(self, reading: Vector, deviation: float) -> None:
        """Begin at the state at rest whose outputs are nearest to the readings.

        What is isolated stays so, with its size for a first guess: a fault that is there cannot be told from the plant
        that begins with it. What only seemed likely is looked for anew.
        """
        design, m = self.design, self.memory
        kept = {one.unknown: float(m.x[one.unknown]) for one in self._decision.isolated if one.unknown >= 0}
        away = ((design.start_outputs - reading) / (20.0 * READING_SCALE))[:, design.used > 0.5]
        start = int(np.argmin((away**2).sum(axis=1)))
        self._flat[:] = 0.0
        m.work[:] = integrator.new_work(design.start_states[start])
        first = np.concatenate([np.full(N_STATES, deviation), design.first / self.rules.rows[:, 2]])
        first[ENERGY] = 0.0
        if not self._decision.isolation.is_open:
            first[N_STATES + len(UNKNOWNS) :] = 0.0
        for unknown, size in kept.items():
            m.x[unknown] = size
            first[N_STATES + unknown] = abs(design.unknowns[unknown].jump) / self.rules.rows[unknown, 2]
        np.fill_diagonal(m.P, first**2)
        for transition in (m.F, m.turned):  # until there is one: without it the covariance would be lost in this tick
            np.fill_diagonal(transition, 1.0)
        m.out[:] = design.start_outputs[start]
        m.scalars[NIS] = 1.0
        self._told[:] = 0.0
        self._told[:N_INPUTS] = design.start_inputs[start]
        m.held[:] = self._told
        self._decision.restart()
        self._begun, self._afresh = True, None

    def _look_afresh(self, time_s: float) -> None:
        """Withdraw what is isolated if an observer that has begun since understands the readings without it."""
        decision, afresh, is_over = self._decision, self._afresh, None
        if afresh is not None:
            self._observe_as(afresh)
            is_over = afresh.compare(self.memory, time_s)
            if is_over:
                self._flat[:] = afresh.flat
                decision.withdraw(afresh.decision)
        if not decision.isolation.is_doubtful:
            self._afresh = None
        elif afresh is None or is_over is not None:
            self._afresh = Afresh(self._flat, packed(rules_of(self.design)), self.design.unknowns, decision)

    def observe(
        self,
        time_s: float,
        measured: Signal,
        air_inlet_temperature_c: float,
        condenser_air_inlet_temperature_c: float,
        air_mass_flow_kg_s: float | None = None,
    ) -> Detection:
        """Return innovation, residuals and decision of this tick.

        Parameters
        ----------
        time_s : float
            Time of the tick.
        measured : sequence of float, length 4
            Evaporator pressure [Pa], superheat [K], wall temperature [degC], condenser pressure [Pa]. Those that the
            design does not use may be anything finite.
        air_inlet_temperature_c, condenser_air_inlet_temperature_c : float
        air_mass_flow_kg_s : float, optional
            Through the evaporator, for a design whose `blower` is known; others have no use for it.
        """
        reading = self._reading
        for i, value in enumerate(measured):
            reading[i] = value
        if not self._begun:
            self._begin(reading, _NEAR)
        if self.curve.size:
            self._take_outlet_temperature(self.memory.out, self.memory.scalars, self.curve, reading, float(reading[0]))
        self._tell(air_inlet_temperature_c, condenser_air_inlet_temperature_c, air_mass_flow_kg_s)
        kalman.observe(self._flat, self._packed, reading, self._told, self._tab)
        return self.conclude(time_s, air_inlet_temperature_c, condenser_air_inlet_temperature_c, air_mass_flow_kg_s)

    def conclude(
        self,
        time_s: float,
        air_inlet_temperature_c: float,
        condenser_air_inlet_temperature_c: float,
        air_mass_flow_kg_s: float | None = None,
    ) -> Detection:
        """Return what follows from the readings of this tick, which the observer has taken."""
        if self._decision.isolation.rival is not None:
            self._observe_as(self._decision.isolation.rival)
        self._look_afresh(time_s)
        m, done = self.memory, self._decision.step(time_s)
        if self._decision.isolation.is_lost:
            self._begin(self._reading, _FAR)
            self._tell(air_inlet_temperature_c, condenser_air_inlet_temperature_c, air_mass_flow_kg_s)
        elif self._decision.doubts:  # the plant is another one: from now on its parameters are estimated, too
            self._decision.open_up()
            self._begin(self._reading, _NEAR)
            self._tell(air_inlet_temperature_c, condenser_air_inlet_temperature_c, air_mass_flow_kg_s)
        (p, s, w, _), (scale_p, scale_s, scale_w, _) = m.e.tolist(), self._shown
        f_n, f_p, *_ = m.x.tolist()
        return Detection(Innovation(p * scale_p, s * scale_s, w * scale_w), (f_n, f_p), *done)

    def _observe_as(self, rival: Rival | Afresh) -> None:
        """Let another observer take the readings of this tick."""
        reading = self._reading.copy()
        if self.curve.size:
            self._take_outlet_temperature(
                rival.memory.out, rival.memory.scalars, self.curve, reading, float(self.memory.out[0])
            )
        rival.observe(reading, self._told, self._tab)

    def commanded(self, command: Signal) -> None:
        """Close the tick with the command [rad/s, 0..1] that the controller has sent.

        Must be called once after each `observe`: the observer moves on to the next tick here.
        """
        self._told[SPEED], self._told[OPENING] = command
        if self._decision.isolation.rival is not None:
            self._decision.isolation.rival.predict(self._told, self._tab)
        if self._afresh is not None:
            self._afresh.predict(self._told, self._tab)
        if kalman.predict(self._flat, self._packed, self._told, self._tab) != 0:
            self.begin_anew()

    @property
    def compiled(self) -> tuple[Any, ...]:
        """Return what compiled code needs: memory, rules, readings, what drives the plant, tables, `is_quiet`'s."""
        decision = self._decision
        return self._flat, self._packed, self._reading, self._told, self._tab, decision.asked, decision.thresholds

    def follow(self, first_s: float, last_s: float) -> Conclusion:
        """Go on from quiet ticks that other code has done, and return what holds in the last of them."""
        return self._decision.rest(first_s, last_s)

    def begin_anew(self) -> None:
        """Begin at the rest that is nearest to the last readings: no state near this one goes on inside the tables."""
        self._begin(self._reading, _FAR)

    def _tell(self, air_c: float, condenser_air_c: float, air_kg_s: float | None) -> None:
        self._told[AIR_C], self._told[_CONDENSER_AIR_C] = air_c, condenser_air_c
        if air_kg_s is not None and self.design.blower > 0.5:
            self._told[_AIR] = air_kg_s

    def warm_restart(
        self,
        measured: Signal,
        air_inlet_temperature_c: float,
        condenser_air_inlet_temperature_c: float,
        command: Signal,
        missed_ticks: int | None = None,
        air_mass_flow_kg_s: float | None = None,
    ) -> None:
        """Go over ticks that were missed, with what the plant is driven by moving in straight lines.

        Call it before `observe`, with that tick's measurements and the command before. The decision stands still. When
        it is not known what was before (None), the observer begins anew at the rest that is nearest to these.
        """
        self._reading[: len(measured)] = measured
        if missed_ticks is None or not self._begun:
            self._begin(self._reading, _FAR)
            self._told[SPEED], self._told[OPENING] = command
            self._tell(air_inlet_temperature_c, condenser_air_inlet_temperature_c, air_mass_flow_kg_s)
            return
        start = self._told.copy()
        self._told[SPEED], self._told[OPENING] = command
        self._tell(air_inlet_temperature_c, condenser_air_inlet_temperature_c, air_mass_flow_kg_s)
        end = self._told.copy()
        for tick in range(1, missed_ticks + 1):
            self._told[:] = start + (end - start) * (tick / (missed_ticks + 1))
            if kalman.predict(self._flat, self._packed, self._told, self._tab) != 0:
                self.warm_restart(
                    measured,
                    air_inlet_temperature_c,
                    condenser_air_inlet_temperature_c,
                    command,
                    air_mass_flow_kg_s=air_mass_flow_kg_s,
                )
                return
        self._decision.restart()
        self._afresh = None

    def state(self) -> dict[str, Any]:
        """Return what a detector that takes this one's place needs, fit for JSON (nan, inf); between two ticks."""
        return {
            "memory": self._flat[: self._remembered].tolist(),
            "told": self._told.tolist(),
            "reading": self._reading.tolist(),
            "begun": self._begun,
            "decision": self._decision.state(),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take the place of the detector whose `state` this is.

        Raises
        ------
        ValueError
            When it is none of a detector of this design.
        """
        try:
            flat = same_shape(state["memory"], self._flat[: self._remembered])
            told, reading = same_shape(state["told"], self._told), same_shape(state["reading"], self._reading)
            begun = bool(state["begun"])
            self._decision.restore(state["decision"])
        except (KeyError, TypeError, ValueError) as problem:
            msg = f"not the state of such a detector: {type(problem).__name__} {problem}"
            raise ValueError(msg) from None
        self._flat[: self._remembered], self._told[:], self._reading[:], self._begun = flat, told, reading, begun
        self._afresh = None  # another one begins where this one is
