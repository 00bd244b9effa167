"""What a run leaves behind, as arrays: the same for a bag read back and for the loop run in one process."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ac_common.fdi_status import StatusRow


@dataclass
class Recording:
    """Every signal of one run, tick by tick, in the units of the wire (SI; temperatures of air and wall in degC).

    Attributes
    ----------
    time_s : (ticks,) seconds since the first tick.
    series : each (ticks,); the key is the topic for a scalar (``plant/superheat``) and ``topic:joint`` for a joint
        (``controller/command:compressor``). `ac_common.topics.SERIES` lists them. A tick whose message is missing
        (realtime, or a bag cut short) is nan.
    status : one row for each ``fdi/status``, in order of time.
    metadata : what was run: at least ``scenario`` (the whole scenario as plain dict), ``mode`` ("lockstep",
        "realtime" or "simulate"), ``passive``, ``sample_time_s``; where known ``wall_seconds``, ``missed_ticks``,
        ``command_latency_ms`` (from measurement to command: ``p50``, ``p99``, ``max``), ``complete`` (False for a bag
        cut short), ``events`` (what nodes announced: ``time_s``, ``node``, ``what``), ``restarts`` (of nodes that
        had died: ``node``, ``died_s``, ``back_s``, ``reason``).
    """

    time_s: NDArray[np.float64]
    series: dict[str, NDArray[np.float64]]
    status: list[StatusRow] = field(default_factory=list)
    metadata: dict[str, Any] = field(default_factory=dict)
