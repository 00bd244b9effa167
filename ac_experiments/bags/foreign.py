"""Bags of the loop that somebody else has recorded, such as `ros2 bag record`: what was run, as far as topics tell."""

from typing import Any

import numpy as np

from ac_common.design_file import ENVELOPE, PAPER
from ac_common.fdi_status import status_row
from ac_common.sample_time import LONGEST_SAMPLE_TIME_S, SHORTEST_SAMPLE_TIME_S
from ac_common.topics import BY_NAME
from ac_common.wire import NANOSECONDS, columns, read_diagnostics, stamp_ns, stamps_ns

#: The topic with which a tick begins, and what tells the operating point.
BEAT, REFERENCE = "plant/evaporator_pressure", "reference/evaporator_pressure"
ADDED, FDI_STATUS = "compensator/q", "fdi/status"
POINTS = ("low", "med", "high")
#: Stamps from then on are the wall clock's: a lockstep run counts from 0.
WALL_CLOCK_NS = 10**9 * NANOSECONDS


def inferred_run(messages: dict[str, list[bytes]]) -> dict[str, Any] | None:
    """Return what a bag without a record of ours seems to be of; None when it holds no ticks of the loop.

    The scenario is one without faults at the operating point whose pressure is nearest to the first reference, so
    nothing is judged that only the scenario knows: what was injected stands in the topics of faults.

    Parameters
    ----------
    messages : dict from topic (relative) to serialised messages
    """
    beats = np.unique(stamps_ns(messages.get(BEAT, [])))
    if len(beats) < 2:
        return None
    period_s = float(np.median(np.diff(beats))) / NANOSECONDS
    sample_time_s = min(max(round(period_s, 3), SHORTEST_SAMPLE_TIME_S), LONGEST_SAMPLE_TIME_S)
    ticks = round((int(beats[-1]) - int(beats[0])) / NANOSECONDS / sample_time_s) + 1
    name = REFERENCE if messages.get(REFERENCE) else BEAT
    pressure_pa = float(columns(BY_NAME[name], messages[name][:1])[0][0])
    added = columns(BY_NAME[ADDED], messages.get(ADDED, []))
    passive = bool(messages.get(ADDED)) and not any(np.any(column) for column in added)
    return {
        "scenario": {
            "name": "recorded",
            "design": _design(messages.get(FDI_STATUS, [])),
            "operating_point": _nearest_point(pressure_pa),
            "duration_s": ticks * sample_time_s,
            "sample_time_s": sample_time_s,
        },
        "mode": "realtime" if stamp_ns(messages[BEAT][0]) > WALL_CLOCK_NS else "lockstep",
        "passive": passive,
        "sample_time_s": sample_time_s,
        "ticks": ticks,
        "inferred": True,
    }


def _design(status: list[bytes]) -> str:
    """Return which design has decided: at an operating point thresholds are constant, over the envelope they move."""
    limits = set()
    for data in status:
        try:
            limits.add(status_row(read_diagnostics(data)[0].values, 0.0).thresholds)
        except (ValueError, IndexError):
            continue
    return ENVELOPE if len(limits) > 1 else PAPER


def _nearest_point(pressure_pa: float) -> str:
    from ac_plant_node.rest import rest_at

    return min(POINTS, key=lambda point: abs(float(rest_at(point)["outputs"][0]) - pressure_pa))
