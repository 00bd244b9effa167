"""What a run of a campaign has left, gathered from its bag."""

import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ac_common.health import HealthReport, Restart, missed_ticks
from ac_common.topics import BY_NAME, COMPENSATOR, CONTROLLER, PLANT
from ac_common.units import KPA
from ac_common.wire import NANOSECONDS, columns, stamps_ns
from ac_design import design_controller
from ac_experiments.bags.reader import RawBag, first_stamp_ns, health_reports, loop_messages, read_raw, recording_of
from ac_experiments.campaign.checks import Evidence, Limits
from ac_experiments.campaign.plan import Plan
from ac_experiments.report.nodes import reports_of

COMMAND = BY_NAME["controller/command"]


def gather(
    plan: Plan,
    bag: Path,
    problem: str,
    restarts: Sequence[Restart],
    left: Sequence[str],
    stalls: Sequence[tuple[float, float]],
) -> Evidence:
    """Return what a run has left, for the checks.

    Parameters
    ----------
    plan
        What was done.
    bag
        Folder of the recording.
    problem, restarts, left
        As in `Evidence`.
    stalls
        Late wake-ups, (due, woken) on the monotonic clock.
    """
    scenario = plan.scenario
    design = design_controller(scenario.operating_point, scenario.sample_time_s)
    limits = Limits(design.command_min, design.command_max, design.command_rate * scenario.sample_time_s)
    raw = read_raw(bag)
    recording = recording_of(raw, bag)
    messages = loop_messages(raw, COMMAND)
    stamps = stamps_ns(messages)
    order = np.argsort(stamps, kind="stable")
    first = first_stamp_ns(raw)
    first_s = first / NANOSECONDS + time.monotonic() - time.time()  # stamps are the wall clock's
    rejected: dict[str, dict[str, int]] = {}
    reports = list(health_reports(raw))
    missed = missed_ticks([values for name, values in reports if name == PLANT], scenario.sample_time_s)
    for name, values in reports:
        for reason, count in HealthReport.read(values).rejected.items():
            by_reason = rejected.setdefault(name, {})
            by_reason[reason] = max(by_reason.get(reason, 0), count)
    return Evidence(
        plan=plan,
        problem=problem,
        ticks=len(recording.time_s),
        command=np.column_stack(columns(COMMAND, messages))[order],
        command_s=(stamps[order] - first) / NANOSECONDS,
        pressure_kpa=recording.series["plant/evaporator_pressure"] / KPA,
        superheat_k=recording.series["plant/superheat"],
        restarts=restarts,
        rejected=rejected,
        limits=limits,
        left=left,
        told={each.tick for each in missed},
        stand_ins=_stand_ins(raw),
        stalls=[(due_s - first_s, woke_s - first_s) for due_s, woke_s in stalls],
    )


def _stand_ins(raw: RawBag) -> list[tuple[float, str, int, int]]:
    """Return what `Evidence.stand_ins` holds."""
    found = []
    for report in reports_of(raw):
        if report.node in (COMPENSATOR, CONTROLLER):
            missing = max(report.health.missing.values(), default=0)
            found.append((report.time_s, report.node, report.health.ticks or 0, missing))
    return found
