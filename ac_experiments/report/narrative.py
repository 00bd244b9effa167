"""A run told in words: what happened, what was seen of it, what came of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ac_common.faults import BY_KIND, UNKNOWN, called
from ac_experiments.decisions import told_sure
from ac_experiments.report.nodes import Event

GOOD, BAD, PLAIN = "good", "bad", "plain"
#: Of so many false alarms it is told when they were.
MOST_ALARMS = 4


@dataclass(frozen=True)
class Sentence:
    """One line of the narrative: whether it tells of something good, and its text (plain, no HTML)."""

    kind: str
    text: str


def narrative(
    summary: Mapping[str, Any], other: Mapping[str, Any] | None = None, events: Sequence[Event] = ()
) -> list[Sentence]:
    """Tell a run in a few sentences.

    Parameters
    ----------
    summary
        Of the run (`ac_experiments.metrics.summarise`).
    other
        Of the run beside it, with the other kind of control.
    events
        What the nodes reported.
    """
    told = []
    for number, fault in enumerate(summary["faults"]):
        beside = other["faults"][number] if other and number < len(other["faults"]) else None
        told += _fault(fault, summary["passive"], beside)
    if not summary["faults"]:
        told.append(Sentence(PLAIN, "No fault was injected."))
    told.append(_at_rest(summary))
    alarms = summary["false_alarm_list"]
    told.append(Sentence(GOOD, "No false alarm.") if not alarms else Sentence(BAD, _alarms(alarms)))
    if not summary["complete"]:
        told.append(Sentence(BAD, "The recording was cut short; the figures cover what is there."))
    missed = summary["missed_ticks"]
    if missed:
        told.append(Sentence(BAD, f"{missed} of {summary['ticks']} ticks came without a new command in time."))
    if events:
        nodes = sorted({event.node for event in events})
        what = "1 event" if len(events) == 1 else f"{len(events)} events"
        told.append(Sentence(BAD, f"{what} reported by {', '.join(nodes)}: see Events."))
    return told


def _fault(fault: Mapping[str, Any], passive: bool, beside: Mapping[str, Any] | None) -> list[Sentence]:
    size, kind = fault["size"], BY_KIND[fault["kind"]]
    how = kind.more if size >= 0 else kind.less
    begins = f"{kind.subject} begins to {kind.verb} {abs(size):g} {kind.unit} {how}"
    if fault.get("stuck"):
        begins = f"{kind.subject} stands still and comes to {kind.verb} up to {abs(size):.3g} {kind.unit} {how}"
    until = "" if fault["end_s"] is None else f"; until {fault['end_s']:g} s"
    told = [Sentence(PLAIN, f"At {fault['onset_s']:g} s {begins}{until}.")]
    told.append(_diagnosis(fault))
    told.append(_effect(fault, passive, beside))
    return told


def _diagnosis(fault: Mapping[str, Any]) -> Sentence:
    if fault["detected_s"] is None:
        return Sentence(BAD, "It was not detected.")
    seen = f"Detected {fault['detected_s'] - fault['onset_s']:.1f} s later"
    named = fault["isolated_as"]
    if named is None:
        return Sentence(BAD, f"{seen}, but not isolated.")
    after = fault["isolated_s"] - fault["onset_s"]
    sure = told_sure(fault, fault["isolated_s"], fault["onset_s"], ", sure after {:.1f} s")
    if named == UNKNOWN and not BY_KIND[fault["kind"]].has_filter:
        return Sentence(GOOD, f"{seen}, isolated as {called(named)} after {after:.1f} s: no filter is for it.")
    if named != fault["kind"]:
        return Sentence(BAD, f"{seen}, but isolated wrongly, after {after:.1f} s, as {called(named)}{sure}.")
    size = "" if fault["estimate"] is None else f"; its size was estimated as {fault['estimate']:.1f} {fault['unit']}"
    return Sentence(GOOD, f"{seen}, isolated as {called(named)} after {after:.1f} s{sure}{size}.")


def _effect(fault: Mapping[str, Any], passive: bool, beside: Mapping[str, Any] | None) -> Sentence:
    """Return what it did to the actual evaporator pressure, beside what it does with the other kind of control."""
    if fault["peak_pressure_error_kpa"] is None:
        return Sentence(PLAIN, "What it did to the evaporator pressure was not recorded.")
    text = f"The actual evaporator pressure {_course(fault)}."
    if beside is not None and beside["peak_pressure_error_kpa"] is not None:
        text += f" {'With' if passive else 'Without'} accommodation it {_course(beside)}."
    return Sentence(PLAIN if fault["settled_s"] is not None else BAD, text)


def _course(fault: Mapping[str, Any]) -> str:
    peak = f"{fault['peak_pressure_error_kpa']:.2f} kPa"
    within = f"{fault['settled_within_kpa']:.2f} kPa"
    if fault["settled_s"] is None:
        return f"left its reference by up to {peak} and did not come back to within {within}"
    after = fault["settled_s"] - fault["onset_s"]
    if after <= 0.0:
        return f"stayed within {peak} of its reference"
    return f"left its reference by up to {peak} and was back within {within} for good after {after:.1f} s"


def _alarms(alarms: Sequence[Mapping[str, Any]]) -> str:
    """Tell of false alarms: how many, and of the first few when, as what and for how long."""
    each = []
    for alarm in alarms[:MOST_ALARMS]:
        what = "a fault was detected" if alarm["kind"] is None else f"{called(alarm['kind'])} was named"
        until = "to the end" if alarm["length_s"] is None else f"for {alarm['length_s']:.1f} s"
        each.append(f"at {alarm['time_s']:.1f} s {what}, {until}{told_sure(alarm)}")
    more = f"; and {len(alarms) - MOST_ALARMS} more" if len(alarms) > MOST_ALARMS else ""
    return f"{len(alarms)} false alarm{'s' if len(alarms) > 1 else ''}: {'; '.join(each)}{more}."


def _at_rest(summary: Mapping[str, Any]) -> Sentence:
    metrics = summary["metrics"]
    change, error = metrics["command_change_rpm"], metrics["steady_pressure_error_kpa"]
    parts = []
    if change is not None and summary["faults"]:
        parts.append(
            f"the compressor is commanded {_signed(change, 'rpm', 'faster', 'slower')} than before the last fault"
        )
    if error is not None:
        parts.append(f"the actual evaporator pressure is {_signed(error, 'kPa', 'above', 'below', 2)} its reference")
    return Sentence(PLAIN, f"At the end {' and '.join(parts)}." if parts else "Nothing is known of the end.")


def _signed(value: float, unit: str, more: str, less: str, digits: int = 1) -> str:
    return f"{abs(value):.{digits}f} {unit} {more if value >= 0 else less}"
