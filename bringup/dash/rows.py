"""Messages of many topics, put together to rows of time plots, in the units of the people. Pure: no ROS, no Bokeh.

A row is one instant of the loop: all values that carry the same stamp. Rows are kept for a while, so that a page opened
late shows what has been, and no longer, so that nothing grows.
"""

import math
import threading
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

import numpy as np

from ac_common.faults import ISOLABLE, ISOLABLE_KINDS, UNFILTERED, Fault
from ac_common.fdi_status import StatusRow
from ac_common.topics import AIR, BY_NAME, CAR, COMPRESSOR, CONDENSER_AIR, VALVE, residual_of, truth_of
from ac_common.units import KPA, RPM

#: Least time between two rows, s: more often nobody can see.
ROW_PERIOD_S = 0.1
#: What a time plot shows, s.
WINDOW_S = 300.0
#: How many rows are kept.
MOST_ROWS = round(WINDOW_S / ROW_PERIOD_S)
#: Stamps that may wait for their last message.
MOST_WAITING = 5
#: A gap in the stamps that is longer than this, s, is shown as one.
GAP_S = 1.0
#: Stamps that go back by more than this, s, are another run's: no message is so late.
BACK_S = 5.0
#: So are those that go on by more than this, s: from a lockstep run's zero to the wall clock.
ON_S = 30 * 86400.0


def threshold_column(fault: Fault) -> str:
    """Return the column of a residual's threshold; that on the other side of zero ends in ``_low``."""
    return f"threshold_{fault.residual_symbol}"


#: What the page shows: column, the series it is from (a topic, or ``topic:joint``), how much of SI one unit is. Of a
#: fault without a filter, whose plot it shares with others, that is a per cent of the largest.
COLUMNS = (
    ("p_e", "plant/evaporator_pressure", KPA),
    ("p_e_measured", "measured/evaporator_pressure", KPA),
    ("p_e_reference", "reference/evaporator_pressure", KPA),
    ("superheat", "plant/superheat", 1.0),
    ("superheat_measured", "measured/superheat", 1.0),
    ("superheat_reference", "reference/superheat", 1.0),
    ("wall", "plant/wall_temperature", 1.0),
    ("wall_measured", "measured/wall_temperature", 1.0),
    ("p_c", "plant/condenser_pressure", KPA),
    ("speed", f"controller/command:{COMPRESSOR}", RPM),
    ("speed_actual", f"actuator/command:{COMPRESSOR}", RPM),
    ("valve", f"controller/command:{VALVE}", 0.01),
    ("q_speed", f"compensator/q:{COMPRESSOR}", RPM),
    ("q_valve", f"compensator/q:{VALVE}", 0.01),
    ("air_flow", f"scenario/air:{AIR}", 0.001),
    ("air_inlet", "scenario/air_inlet_temperature", 1.0),
    ("condenser_flow", f"scenario/condenser_air:{CONDENSER_AIR}", 0.001),
    ("condenser_inlet", "scenario/condenser_air_inlet_temperature", 1.0),
    ("humidity", "scenario/air_humidity", 0.01),
    ("vents", "plant/vent_temperature", 1.0),
    ("cabin", "plant/car:cabin_air", 1.0),
    *((fault.symbol, truth_of(fault.kind), fault.si) for fault in ISOLABLE),
    *((fault.symbol, truth_of(fault.kind), fault.largest_si / 100.0) for fault in UNFILTERED),
    *((fault.residual_symbol, residual_of(fault.kind), fault.si) for fault in ISOLABLE),
    *((threshold_column(fault), f"fdi/status:{fault.kind}", fault.si) for fault in ISOLABLE),
)
#: Columns of a row, in order; `t` is the time since the first stamp of the run, s.
NAMES = ("t", *(name for name, _, _ in COLUMNS))
#: Topics that the page needs.
TOPIC_NAMES = tuple(dict.fromkeys(series.partition(":")[0] for _, series, _ in COLUMNS))

_PLACE = {series: (i, unit) for i, (_, series, unit) in enumerate(COLUMNS, start=1)}
_SILENT = {key for topic in BY_NAME.values() if topic.silent_at_zero for key in topic.series}
UNAWAITED = _SILENT | {key for topic in CAR for key in topic.series}
"""Series that a row does not wait for: what is silent at zero, and what only a run with a car has."""
_EMPTY = [math.nan, *(0.0 if series in _SILENT else math.nan for _, series, _ in COLUMNS)]
"""A row of which nothing is known yet; what is silent at zero may say nothing at all."""
_AWAITED = [place for series, (place, _) in _PLACE.items() if series not in UNAWAITED]

Row = tuple[float, ...]


def threshold_values(status: StatusRow) -> dict[str, float]:
    """Give what a detector's decision adds to a row."""
    return {f"fdi/status:{kind}": limit for kind, limit in zip(ISOLABLE_KINDS, status.thresholds, strict=True)}


def columns_of(rows: list[Row]) -> dict[str, Any]:
    """Return the rows as one array a column, as a plot wants them; the thresholds on both sides of zero."""
    table = np.array(rows, dtype=np.float64).reshape(len(rows), len(NAMES))
    columns = {name: table[:, i] for i, name in enumerate(NAMES)}
    for name in map(threshold_column, ISOLABLE):
        columns[f"{name}_low"] = -columns[name]
    return columns


@dataclass
class Rows:
    """The last rows, filled by one thread and read by others.

    Attributes
    ----------
    generation : int
        Grows whenever another run begins: what was read before belongs to the one before.
    """

    generation: int = 0
    _rows: deque[Row] = field(default_factory=lambda: deque(maxlen=MOST_ROWS))
    _count: int = 0  # rows of this generation, those that are gone included
    _waiting: dict[int, list[float]] = field(default_factory=dict)
    _first_ns: int = -1
    _last_ns: int = -1  # stamp of the newest row
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def add(self, time_ns: int, values: Mapping[str, float]) -> None:
        """Add what one message says, in SI, under the names of its series; those nobody wants are left out."""
        with self._lock:
            newest = max(self._waiting, default=self._last_ns)
            if self._first_ns < 0 or not -BACK_S * 1e9 <= time_ns - newest <= ON_S * 1e9:
                self._begin(time_ns)
            if self._last_ns >= 0 and time_ns - self._last_ns < (ROW_PERIOD_S - 1e-3) * 1e9:
                return  # its row is closed, or it is between two rows
            row = self._waiting.setdefault(time_ns, _EMPTY.copy())
            for series, value in values.items():
                if series in _PLACE:
                    place, unit = _PLACE[series]
                    row[place] = value / unit
            row[0] = (time_ns - self._first_ns) / 1e9
            if not any(math.isnan(row[place]) for place in _AWAITED):
                self._close(time_ns)
            elif len(self._waiting) > MOST_WAITING:
                self._close(min(self._waiting))

    def since(self, generation: int, count: int) -> tuple[int, int, list[Row]]:
        """Return the rows that a reader has not seen yet.

        Parameters
        ----------
        generation, count
            What the reader was told last; of another generation it gets everything that is there.

        Returns
        -------
        tuple
            Generation and count to come back with, and the rows, oldest first.
        """
        with self._lock:
            seen = count if generation == self.generation else 0
            fresh = min(self._count - seen, len(self._rows))
            return self.generation, self._count, list(islice(self._rows, len(self._rows) - fresh, None))

    @property
    def first_ns(self) -> int:
        """Stamp from which the rows count; -1 when there are none."""
        return self._first_ns

    @property
    def newest_ns(self) -> int:
        """Stamp of the newest row; -1 when there is none."""
        return self._last_ns

    @property
    def newest(self) -> dict[str, float]:
        """The newest row by column; empty when there is none."""
        with self._lock:
            return dict(zip(NAMES, self._rows[-1], strict=True)) if self._rows else {}

    def _begin(self, time_ns: int) -> None:
        self.generation += 1
        self._rows.clear()
        self._waiting.clear()
        self._count = 0
        self._first_ns, self._last_ns = time_ns, -1

    def _close(self, time_ns: int) -> None:
        """Append a row, and those before it as they are: what they lack will not come any more."""
        for stamp in sorted(stamp for stamp in self._waiting if stamp <= time_ns):
            if self._rows and stamp - self._last_ns > GAP_S * 1e9:
                self._append([self._rows[-1][0] + ROW_PERIOD_S] + [math.nan] * (len(NAMES) - 1))
            self._append(self._waiting.pop(stamp))
            self._last_ns = stamp

    def _append(self, row: list[float]) -> None:
        self._rows.append(tuple(row))
        self._count += 1
