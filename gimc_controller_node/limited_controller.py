"""Any controller within the limits of what it commands: reference governor in front, limits behind, q never a jump.

    r -> reference governor -> controller -> limits in size and rate, caps -> u
                          q -> fade ---^            |
                                       ^-- sent ----'

When a limit holds one command back, the other one does what is missing as far as it can: of all commands within the
limits, the one is sent whose outputs are nearest to what was wanted, some seconds ahead (`ControllerDesign.priority`).
The references have passed the governor (`gimc_controller_node.reference_governor`).
"""

import math

import numpy as np

from gimc_controller_node.controller import Command, Controller, ControllerDesign, GimcController, Vector
from gimc_controller_node.reference_governor import ReferenceGovernor

Q_FADE_S = 0.5
"""Time constant with which q fades out when it stops arriving, and with which it is met again when it is back."""


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
    at_limit : tuple of bool
        Whether the last command of compressor and valve was held back by a limit, in size or in rate, or makes up for
        the other one, which was.
    """

    def __init__(self, controller: Controller, design: ControllerDesign) -> None:
        self.design = design
        self._controller = controller
        self._q, self._q_offset = [0.0, 0.0], [0.0, 0.0]
        self._q_silent = self._q_met = False
        self._q_keeps = math.exp(-design.sample_time_s / Q_FADE_S)
        self._last: list[float] = design.command_rest.tolist()
        self._low: list[float] = design.command_min.tolist()
        self._high: list[float] = design.command_max.tolist()
        self._stride: list[float] = (design.command_rate * design.sample_time_s).tolist()
        self._governors = [
            ReferenceGovernor(lead, lag_s, design.sample_time_s)
            for lead, lag_s in zip(design.lead.tolist(), design.lag_s.tolist(), strict=True)
        ]
        (self._cost_speed, self._cost_both), (_, self._cost_valve) = design.priority.tolist()
        self._is_curved = design.is_curved
        self._caps = (math.inf, math.inf)
        self.at_limit = (False, False)

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
        wanted_pressure, wanted_superheat = reference.tolist()
        for_pressure, for_superheat = self._governors
        governed = np.array([for_pressure.step(wanted_pressure), for_superheat.step(wanted_superheat)])
        wanted = self._controller.step(governed, measurement[:2], np.array(self._faded(q)))
        speed, valve = map(float, wanted)
        last, low, high, stride = self._last, self._low, self._high, self._stride
        slowest, narrowest = max(low[0], last[0] - stride[0]), max(low[1], last[1] - stride[1])
        fastest, widest = min(high[0], last[0] + stride[0]), min(high[1], last[1] + stride[1])
        if slowest <= speed <= fastest and narrowest <= valve <= widest:
            sent_speed, sent_valve = speed, valve
        else:
            sent_speed, sent_valve = self._nearest(speed, valve, (slowest, fastest), (narrowest, widest))
        # What a cap takes away the other command must not make up for: the cap is there to change the outputs.
        sent_speed = max(min(sent_speed, self._caps[0]), slowest)
        sent_valve = max(min(sent_valve, self._caps[1]), narrowest)
        self.at_limit = (sent_speed != speed, sent_valve != valve)
        last[0], last[1] = sent_speed, sent_valve
        sent = np.array([sent_speed, sent_valve])
        self._controller.sent(sent)
        return sent

    def cap(self, speed_rad_s: float, opening: float) -> None:
        """Keep the commands below these caps from now on; inf takes a cap away.

        A cap below the last command is met at the command's greatest rate.
        """
        self._caps = (speed_rad_s, opening)

    def drive(self, speed_rad_s: float) -> None:
        """Take the compressor's speed as given from now on: an engine turns it, and only the valve is commanded.

        Cap and rate of the speed have no say then; the command states the speed that there is.
        """
        self._low[0] = self._high[0] = speed_rad_s
        self._stride[0] = math.inf

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
        self._last[:] = sent.tolist()
        self._q[:] = self._q_offset[:] = [0.0, 0.0]
        self._q_silent = True

    def _nearest(
        self, speed: float, valve: float, speeds: tuple[float, float], valves: tuple[float, float]
    ) -> tuple[float, float]:
        """Return the command within the limits nearest to the one wanted, which is beyond them: it is on an edge.

        Nearest in the coordinates in which the design is linear.
        """
        if self._is_curved:
            to, low, high = self.design.coordinates, *np.transpose([speeds, valves])
            (x, y), least, most = (to(np.array(one)).tolist() for one in ((speed, valve), low, high))
            nearest = self._nearest_in(x, y, (least[0], most[0]), (least[1], most[1]))
            sent = np.clip(self.design.command_at(np.array(nearest)), low, high)
            return float(sent[0]), float(sent[1])
        return self._nearest_in(speed, valve, speeds, valves)

    def _nearest_in(
        self, speed: float, valve: float, speeds: tuple[float, float], valves: tuple[float, float]
    ) -> tuple[float, float]:
        own, both, other = self._cost_speed, self._cost_both, self._cost_valve
        edges = [(edge, _within(valve - both / other * (edge - speed), valves)) for edge in speeds]
        edges += [(_within(speed - both / own * (edge - valve), speeds), edge) for edge in valves]
        least, best = math.inf, (math.nan, math.nan)
        for there in edges:
            x, y = there[0] - speed, there[1] - valve
            cost = own * x * x + 2.0 * both * x * y + other * y * y
            if cost < least:
                least, best = cost, there
        return best

    def _faded(self, q: Vector | None) -> list[float]:
        """Return what is used of q: q itself, but for the fades around a silence."""
        used, offset, keeps = self._q, self._q_offset, self._q_keeps
        if q is None:
            used[0], used[1] = keeps * used[0], keeps * used[1]
            self._q_silent = True
            return used
        speed, valve = q.tolist()
        if self._q_silent:  # the first one after a silence
            self._q_silent, self._q_met = False, True
            offset[0], offset[1] = used[0] - speed, used[1] - valve
        if self._q_met:
            offset[0], offset[1] = keeps * offset[0], keeps * offset[1]
            speed, valve = speed + offset[0], valve + offset[1]
            self._q_met = max(abs(offset[0]), abs(offset[1])) > 1e-12
        used[0], used[1] = speed, valve
        return used


def limited_k0(design: ControllerDesign) -> LimitedController:
    """Return K0 of a design within the limits of the commands."""
    return LimitedController(GimcController(design), design)


def _within(value: float, limits: tuple[float, float]) -> float:
    return min(max(value, limits[0]), limits[1])
