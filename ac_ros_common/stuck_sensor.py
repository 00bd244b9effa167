"""Stuck sensors: a measurement stands still to the last bit while another one moves. Plain bookkeeping."""

from collections.abc import Sequence

#: A measurement is stuck when it has not changed for so long, s,
STUCK_S = 2.0
#: while another one has moved by this much: Pa, K, K.
MOVES = {"measured/evaporator_pressure": 200.0, "measured/superheat": 0.2, "measured/wall_temperature": 0.1}


class StuckSensor:
    """Watches the measurements of a node, tick by tick.

    Parameters
    ----------
    topics : sequence of str
        In the order of the values.
    """

    def __init__(self, topics: Sequence[str]) -> None:
        self._topics = tuple(topics)
        self._last: list[float] = []
        self._since_s: list[float] = []
        # Of each measurement, what all of them were when it last changed.
        self._then: list[list[float]] = []

    def which(self, time_s: float, values: Sequence[float]) -> str:
        """Return the topic of a measurement that is stuck at this tick; empty when there is none."""
        now = list(values)
        if not self._last:
            self._since_s, self._then = [time_s] * len(now), [now] * len(now)
        found = ""
        for i, topic in enumerate(self._topics):
            if not self._last or now[i] != self._last[i]:
                self._since_s[i], self._then[i] = time_s, now
            elif time_s - self._since_s[i] >= STUCK_S and self._others_moved(i, now):
                found = topic
        self._last = now
        return found

    def _others_moved(self, i: int, now: list[float]) -> bool:
        return any(
            abs(value - then) > MOVES[topic]
            for k, (topic, value, then) in enumerate(zip(self._topics, now, self._then[i], strict=True))
            if k != i
        )
