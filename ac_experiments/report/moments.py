"""The instants and times of a run that every plot shows: when a fault came, was seen, was named, and was over."""

import math
import re
from dataclasses import replace

from ac_common.design_file import ENVELOPE, PAPER
from ac_common.faults import BY_KIND, UNKNOWN
from ac_common.fdi_status import NOT_SURE, SURE
from ac_experiments.decisions import unsure_of
from ac_experiments.metrics import fault_summaries, injected_faults
from ac_experiments.recording import Recording
from ac_experiments.report.charts import BLACK, GREEN, GREY, ORANGE, PURPLE, Mark, Span

#: Time that is shown around a fault: from before its onset to after it, s.
BEFORE_S, AFTER_S = 20.0, 100.0
ONSET, DETECTED, ISOLATED, ENDED = "fault begins", "detected", "isolated", "fault ends"
SETTLED = "p<sub>e</sub> back at its reference"
FAULTY = "a fault is there"
UNSURE = "isolated, not sure"
#: The strip along the bottom of a plot that says so: part of the plot's height, opacity.
STRIP, STRIP_SHADE = 0.07, 0.8
#: A time with a fault is shaded over at least this part of a plot.
LEAST_SHADE = 0.006
#: Of `paper`, which filter takes over from the guard when a fault is isolated; of `envelope`, what is corrected.
Q_OF = {"compressor_speed": "Q_act", "evaporator_pressure": "Q_sen"}
ACTED = {"compressor_speed": "the command", "evaporator_pressure": "the reading"}
_INDEX = re.compile(r"_(\w+)")


def subscripted(symbol: str) -> str:
    """Return a symbol such as ``f_N`` as HTML: the part after the line below it."""
    letter, _, index = symbol.partition("_")
    return f"{letter}<sub>{index}</sub>"


def around(fault_onset_s: float) -> tuple[float, float]:
    """Give the stretch of time to show around a fault."""
    return fault_onset_s - BEFORE_S, fault_onset_s + AFTER_S


def spans_of(recording: Recording, start_s: float, stop_s: float) -> list[Span]:
    """Return the times with a fault, or with an unsure name, between two times; all can be seen, short ones too."""
    spans = [Span(fault.onset_s, fault.end_s, FAULTY, ORANGE) for fault in injected_faults(recording)]
    unsure = unsure_of(recording.status)
    spans += [Span(spell.start_s, spell.end_s, UNSURE, PURPLE, STRIP, STRIP_SHADE) for spell in unsure]
    least_s = LEAST_SHADE * (stop_s - start_s)
    found = []
    for span in spans:
        begin_s, end_s = max(span.start, start_s), min(stop_s if math.isnan(span.stop) else span.stop, stop_s)
        if begin_s < end_s:
            found.append(replace(span, start=begin_s, stop=min(max(end_s, begin_s + least_s), stop_s)))
    return found


def acting(recording: Recording, kind: str, time_s: float) -> str:
    """Return what acts on a fault that is isolated at a time, in words; empty where K0 is alone."""
    said = next(row for row in recording.status if row.time_s == time_s)
    if kind not in said.acted_on:
        return NOT_SURE
    if recording.metadata["passive"]:
        return ""
    if kind == UNKNOWN:
        return "q fades out"
    if recording.metadata["scenario"].get("design", PAPER) == ENVELOPE:
        return f"its estimate is taken off {ACTED[kind]}"
    return "Q_both acts" if said.also_isolated else f"{Q_OF[kind]} takes over"


def marks_of(recording: Recording) -> list[Mark]:
    """Return the instants that every plot marks: onset, end, detection, isolation, and when p_e is back.

    A name that is not sure at once is marked when it is; until then `spans_of` shows it.
    """
    marks = []
    for fault in fault_summaries(recording):
        marks.append(Mark(fault["onset_s"], ONSET, BLACK, "dash"))
        if fault["end_s"] is not None:
            marks.append(Mark(fault["end_s"], ENDED, GREY, "dash"))
        if fault["settled_s"] is not None and fault["settled_s"] > fault["onset_s"]:
            marks.append(Mark(fault["settled_s"], SETTLED, GREEN, "dashdot"))
    detections, isolations = instants(recording)
    marks += [Mark(at, DETECTED, PURPLE, "dot") for at in detections]
    named = [(at, kind, ISOLATED) for at, kind in isolations]
    ended = (spell for spell in unsure_of(recording.status) if not math.isnan(spell.end_s))
    named += [(spell.end_s, str(spell.kind), SURE) for spell in ended]
    for at, kind, what in named:
        symbol = kind if kind == UNKNOWN else BY_KIND[kind].symbol
        if (acts := acting(recording, kind, at)) == NOT_SURE:
            continue
        words = ": ".join(part for part in (f"{symbol} {what}", acts) if part)
        marks.append(Mark(at, _INDEX.sub(r"<sub>\1</sub>", words), GREEN, "solid"))
    order = {ONSET: 0, DETECTED: 1, SETTLED: 3, ENDED: 4}
    return sorted(marks, key=lambda mark: (order.get(mark.name, 2), mark.at))


def instants(recording: Recording) -> tuple[list[float], list[tuple[float, str]]]:
    """Find when detections begin, s, and when a fault is named: (s, which)."""
    detections: list[float] = []
    isolations: list[tuple[float, str]] = []
    detected, isolated = False, None
    for row in recording.status:
        if row.detected and not detected:
            detections.append(row.time_s)
        if row.isolated is not None and row.isolated != isolated:
            isolations.append((row.time_s, row.isolated))
        detected, isolated = row.detected, row.isolated
    return detections, isolations
