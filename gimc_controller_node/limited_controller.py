"""Any controller within the limits of what it commands: reference governor in front, limits behind, q never a jump.

    r -> reference governor -> controller -> limits in size and rate, caps -> u
                          q -> fade ---^            |
                                       ^-- sent ----'

When a limit holds one command back, the other one does what is missing as far as it can: of all commands within the
limits, the one is sent whose outputs are nearest to what was wanted, some seconds ahead (`ControllerDesign.priority`).
The references have passed the governor (`gimc_controller_node.reference_governor`).
"""

import math
from typing import Any

import numpy as np

from ac_common.compiled import ready
from gimc_controller_node.compiled import Array, jit
from gimc_controller_node.controller import (
    WANTED,
    Command,
    Controller,
    ControllerDesign,
    GimcController,
    Vector,
    above_rest,
    coordinate,
    k0_sent,
    k0_step,
)
from gimc_controller_node.reference_governor import N_GOVERNOR, ReferenceGovernor, pass_on

Q_FADE_S = 0.5
"""Time constant with which q fades out when it stops arriving, and with which it is met again when it is back."""


# Layout of what a `LimitedController` remembers, and of what it is made of: pairs for speed and valve, or p_e and SH.
LAST, _HELD_BACK, _GOVERNED, _Q, _Q_OFFSET, _LOW, _HIGH, _STRIDE, CAPS, _REST, _CURVATURE = range(0, 22, 2)
_SILENT, _MET, _KEEPS, _COST_SPEED, _COST_BOTH, _COST_VALVE = range(22, 28)
_GOVERNORS = 28
_N = _GOVERNORS + 2 * N_GOVERNOR


@jit
def _fade(m: Array, arrives: int, speed: float, valve: float) -> None:
    """Find what is used of q: q itself, but for the fades around a silence."""
    used, offset, keeps = m[_Q : _Q + 2], m[_Q_OFFSET : _Q_OFFSET + 2], m[_KEEPS]
    if arrives == 0:
        used[0], used[1] = keeps * used[0], keeps * used[1]
        m[_SILENT] = 1.0
        return
    if m[_SILENT] != 0.0:  # the first one after a silence
        m[_SILENT], m[_MET] = 0.0, 1.0
        offset[0], offset[1] = used[0] - speed, used[1] - valve
    if m[_MET] != 0.0:
        offset[0], offset[1] = keeps * offset[0], keeps * offset[1]
        speed, valve = speed + offset[0], valve + offset[1]
        m[_MET] = 1.0 if max(abs(offset[0]), abs(offset[1])) > 1e-12 else 0.0
    used[0], used[1] = speed, valve


@jit
def _before(m: Array, pressure: float, superheat: float, arrives: int, q_speed: float, q_valve: float) -> None:
    """Find what the controller is given: references and q."""
    m[_GOVERNED] = pass_on(m[_GOVERNORS : _GOVERNORS + N_GOVERNOR], pressure)
    m[_GOVERNED + 1] = pass_on(m[_GOVERNORS + N_GOVERNOR : _N], superheat)
    _fade(m, arrives, q_speed, q_valve)


@jit
def _within(value: float, low: float, high: float) -> float:
    return min(max(value, low), high)


@jit
def _nearest_in(
    m: Array, speed: float, valve: float, slowest: float, fastest: float, narrowest: float, widest: float
) -> tuple[float, float]:
    """Return the point of the rectangle's edges which is nearest to one outside."""
    own, both, other = m[_COST_SPEED], m[_COST_BOTH], m[_COST_VALVE]
    least, best_speed, best_valve = math.inf, math.nan, math.nan
    for edge in range(4):
        if edge < 2:
            there_speed = slowest if edge == 0 else fastest
            there_valve = _within(valve - both / other * (there_speed - speed), narrowest, widest)
        else:
            there_valve = narrowest if edge == 2 else widest
            there_speed = _within(speed - both / own * (there_valve - valve), slowest, fastest)
        x, y = there_speed - speed, there_valve - valve
        cost = own * x * x + 2.0 * both * x * y + other * y * y
        if cost < least:
            least, best_speed, best_valve = cost, there_speed, there_valve
    return best_speed, best_valve


@jit
def _to(m: Array, i: int, command: float) -> float:
    """Return the coordinate of a command of the i-th joint."""
    return coordinate(command - m[_REST + i], m[_CURVATURE + i])


@jit
def _nearest(
    m: Array, speed: float, valve: float, slowest: float, fastest: float, narrowest: float, widest: float
) -> tuple[float, float]:
    """Return the command within the limits nearest to the one wanted, which is beyond them: it is on an edge.

    Nearest in the coordinates in which the design is linear.
    """
    if m[_CURVATURE] == 0.0 and m[_CURVATURE + 1] == 0.0:
        return _nearest_in(m, speed, valve, slowest, fastest, narrowest, widest)
    speeds, valves = (_to(m, 0, slowest), _to(m, 0, fastest)), (_to(m, 1, narrowest), _to(m, 1, widest))
    x, y = _nearest_in(m, _to(m, 0, speed), _to(m, 1, valve), speeds[0], speeds[1], valves[0], valves[1])
    speed, valve = above_rest(x, m[_CURVATURE]) + m[_REST], above_rest(y, m[_CURVATURE + 1]) + m[_REST + 1]
    return _within(speed, slowest, fastest), _within(valve, narrowest, widest)


@jit
def _after(m: Array, speed: float, valve: float) -> None:
    """Find the command that is sent for the one that the controller wants."""
    last, low, high, stride = m[LAST:], m[_LOW:], m[_HIGH:], m[_STRIDE:]
    slowest, narrowest = max(low[0], last[0] - stride[0]), max(low[1], last[1] - stride[1])
    fastest, widest = min(high[0], last[0] + stride[0]), min(high[1], last[1] + stride[1])
    if slowest <= speed <= fastest and narrowest <= valve <= widest:
        sent_speed, sent_valve = speed, valve
    else:
        sent_speed, sent_valve = _nearest(m, speed, valve, slowest, fastest, narrowest, widest)
    # What a cap takes away the other command must not make up for: the cap is there to change the outputs.
    sent_speed = max(min(sent_speed, m[CAPS]), slowest)
    sent_valve = max(min(sent_valve, m[CAPS + 1]), narrowest)
    m[_HELD_BACK] = 1.0 if sent_speed != speed else 0.0
    m[_HELD_BACK + 1] = 1.0 if sent_valve != valve else 0.0
    last[0], last[1] = sent_speed, sent_valve


@jit
def with_k0(
    m: Array, k0: Array, n: int, pressure: float, superheat: float, read_pressure: float, read_superheat: float,
    arrives: int, q_speed: float, q_valve: float,
) -> None:  # fmt: skip
    """One tick with K0, whose memory is `k0`: what `LimitedController.step` does with any controller."""
    _before(m, pressure, superheat, arrives, q_speed, q_valve)
    k0_step(k0, n, m[_GOVERNED] - read_pressure, m[_GOVERNED + 1] - read_superheat, m[_Q], m[_Q + 1])
    _after(m, k0[WANTED], k0[WANTED + 1])
    k0_sent(k0, n, m[LAST], m[LAST + 1])


class LimitedController:
    """A controller of any class, whose commands stay within their limits, in size and in rate.

    A new one stands at the operating point: its first command may leave `command_rest` by one tick's worth of rate.
    One that is to take over from something else calls `warm_restart` first.

    Parameters
    ----------
    controller : Controller
    design : ControllerDesign
        Its limits, priority, operating point and sample time are used.

    Attributes
    ----------
    memory : ndarray
        What it remembers and is made of, for compiled code.
    k0 : GimcController or None
        The controller when it is K0.
    """

    def __init__(self, controller: Controller, design: ControllerDesign) -> None:
        self.design = design
        self._controller = controller
        m = self.memory = np.zeros(_N)
        pairs: dict[int, Any] = {
            LAST: design.command_rest, _LOW: design.command_min, _HIGH: design.command_max,
            _STRIDE: design.command_rate * design.sample_time_s, CAPS: (math.inf, math.inf),
            _REST: design.command_rest, _CURVATURE: design.curvature,
        }  # fmt: skip
        for at, pair in pairs.items():
            m[at : at + 2] = pair
        m[_KEEPS] = math.exp(-design.sample_time_s / Q_FADE_S)
        (m[_COST_SPEED], m[_COST_BOTH]), (_, m[_COST_VALVE]) = design.priority
        self._last, self._governed, self._q = (m[at : at + 2] for at in (LAST, _GOVERNED, _Q))
        memories = np.split(m[_GOVERNORS:], 2)
        self._governors = [
            ReferenceGovernor(lead, lag_s, design.sample_time_s, memory)
            for lead, lag_s, memory in zip(design.lead.tolist(), design.lag_s.tolist(), memories, strict=True)
        ]
        self._with_k0 = ready(with_k0)
        self.k0 = controller if type(controller) is GimcController else None  # one of a class of its own is not K0

    @property
    def at_limit(self) -> tuple[bool, bool]:
        """Whether the last command of compressor and valve was held back, or makes up for the other one, which was.

        By a limit, in size or in rate.
        """
        speed, valve = self.memory[_HELD_BACK : _HELD_BACK + 2].tolist()
        return bool(speed), bool(valve)

    def step(self, reference: Vector, measurement: Vector, q: Vector | None) -> Command:
        """Return the command of this tick.

        Parameters
        ----------
        reference : ndarray, shape (2,)
            Evaporator pressure [Pa] and superheat [K] wanted.
        measurement : ndarray, shape (2,) or longer
            The same two, as measured; what follows is not used.
        q : ndarray, shape (2,), or None
            The compensator's signal [rad/s, 0..1]. None: there is none this tick; the last one fades out with the time
            constant `Q_FADE_S`, which leaves the controller alone. When there is one again, the difference to what is
            left of the old one fades in the same way. No switching moves the command by more than a tick's part of
            that.

        Returns
        -------
        ndarray, shape (2,)
            Compressor speed [rad/s] and valve opening [0..1], within their limits, and within their rates of the
            command before. This is what the plant must get, and what the observer must be told.
        """
        pressure, superheat = reference.tolist()
        arrives, q_speed, q_valve = (0, 0.0, 0.0) if q is None else (1, *q.tolist())
        m, k0 = self.memory, self.k0
        if k0 is not None:
            p_e, sh, *_ = measurement.tolist()
            self._with_k0(m, k0.memory, k0.n_states, pressure, superheat, p_e, sh, arrives, q_speed, q_valve)
            return self._last.copy()
        _before(m, pressure, superheat, arrives, q_speed, q_valve)
        wanted = self._controller.step(self._governed.copy(), measurement[:2], self._q.copy())
        _after(m, float(wanted[0]), float(wanted[1]))
        sent = self._last.copy()
        self._controller.sent(sent)
        return sent

    def cap(self, speed_rad_s: float, opening: float) -> None:
        """Keep the commands below these caps from now on; inf takes a cap away.

        A cap below the last command is met at the command's greatest rate.
        """
        self.memory[CAPS], self.memory[CAPS + 1] = speed_rad_s, opening

    def drive(self, speed_rad_s: float) -> None:
        """Take the compressor's speed as given from now on: an engine turns it, and only the valve is commanded.

        Cap and rate of the speed have no say then; the command states the speed that there is.
        """
        m = self.memory
        m[_LOW] = m[_HIGH] = speed_rad_s
        m[_STRIDE] = math.inf

    def warm_restart(self, command: Command, measurement: Vector, reference: Vector) -> None:
        """Take over from whatever moves the actuators now, without a jump.

        Call it once, before the first `step`, with what that step will see. With the same reference, measurement and
        no q the first command of K0 then is `command` (within its limits), and it goes on from there. A q that arrives
        in the first tick is met with its fade.

        Parameters
        ----------
        command : ndarray, shape (2,)
            What the actuators do now: compressor speed [rad/s], valve opening [0..1].
        measurement : ndarray, shape (2,) or longer
            Evaporator pressure [Pa] and superheat [K] now.
        reference : ndarray, shape (2,)
            The same two, as wanted.

        Raises
        ------
        ValueError
            When a number is not finite.
        """
        sent = np.minimum(np.maximum(command, self.design.command_min), self.design.command_max)
        measured = measurement[:2]
        for governor, output in zip(self._governors, measured.tolist(), strict=True):
            governor.start(output)
        pairs = zip(self._governors, reference.tolist(), strict=True)
        governed = np.array([governor.governed(wanted) for governor, wanted in pairs])
        if not (np.isfinite(sent).all() and np.isfinite(governed - measured).all()):
            raise ValueError(f"cannot go on from command {command}, measured {measurement}, reference {reference}")
        self._controller.warm_restart(sent, measured, governed)
        self._last[:] = sent
        self._q[:] = self.memory[_Q_OFFSET : _Q_OFFSET + 2] = 0.0
        self.memory[_SILENT] = 1.0


def limited_k0(design: ControllerDesign) -> LimitedController:
    """Return K0 of a design within the limits of the commands."""
    return LimitedController(GimcController(design), design)
