"""The bag of a loop in one process: the messages that the nodes of a lockstep run would have sent, byte by byte."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ac_common.design_file import ATTACHMENT, to_bytes
from ac_common.errors import RunError
from ac_common.health import HealthPart, HealthReport, PlantReport
from ac_common.topics import BY_NAME, CAR, CLOCK, COMPENSATOR, CONTROLLER, FDI, NAMESPACE, PLANT, TOPICS, Topic
from ac_common.wire import NANOSECONDS, Diagnostic, messages_of, pack_diagnostics, pack_status
from ac_experiments.bags.recorder import BagWriter, recorded_topics
from ac_experiments.designs import Designs, EnvelopeDesigns
from ac_experiments.recording import Recording

#: What of a recording's metadata is a result, and not what was run.
_RESULTS = ("wall_seconds", "missed_ticks", "events", "restarts", "complete")


def write_bag(folder: Path, recording: Recording, designs: Designs | EnvelopeDesigns) -> None:
    """Write the bag of a simulated run.

    Parameters
    ----------
    folder
        Of the bag; must not hold one.
    recording
        From `ac_experiments.simulate.simulate`.
    designs
        What it was run with; they are stored with the bag, as the nodes' are.

    Raises
    ------
    UserError
        When the folder holds a bag.
    RunError
        When the bag cannot be written.
    """
    try:
        _write(folder, recording, designs)
    except OSError as problem:
        msg = f"{folder}: cannot be written: {problem.strerror}"
        raise RunError(msg) from None


def _write(folder: Path, recording: Recording, designs: Designs | EnvelopeDesigns) -> None:
    topics = recorded_topics(lockstep=True)
    number_of = {topic.name: number for number, topic in enumerate(topics)}
    run = {key: value for key, value in recording.metadata.items() if key not in _RESULTS}
    bag = BagWriter(folder, topics, {**run, "ticks": len(recording.time_s)})
    times_ns = np.rint(recording.time_s * NANOSECONDS).astype(np.int64)
    clock = messages_of(Topic("clock", CLOCK, "simulated time", PLANT), times_ns, ())
    sent: dict[int, Sequence[bytes | None]] = {number_of["/clock"]: clock}
    for topic in _sent(recording):
        sent[number_of[f"{NAMESPACE}/{topic.name}"]] = _messages(topic, recording, times_ns)
    stamps = times_ns.tolist()
    for stamp, messages in zip(stamps, zip(*sent.values(), strict=True), strict=True):
        for number, data in zip(sent, messages, strict=True):
            if data is not None:
                bag.write(number, data, stamp, stamp)
    bag.write(number_of["/diagnostics"], _health(recording, stamps[-1]), stamps[-1], stamps[-1])
    for node, design in ((FDI, designs.fdi), (COMPENSATOR, designs.compensator), (CONTROLLER, designs.controller)):
        bag.attach(ATTACHMENT.format(node), to_bytes(design))
    bag.close()


def _sent(recording: Recording) -> list[Topic]:
    """List the topics on which the run has sent something."""
    topics = (*TOPICS, *CAR) if CAR[0].series[0] in recording.series else TOPICS
    return [topic for topic in topics if topic == BY_NAME["fdi/status"] or topic.series[0] in recording.series]


def _messages(topic: Topic, recording: Recording, times_ns: NDArray[np.int64]) -> Sequence[bytes | None]:
    """Return the message of a topic for one tick after the other; None where it is silent."""
    if not topic.series:
        told = [pack_status(time_ns, row) for time_ns, row in zip(times_ns.tolist(), recording.status, strict=True)]
        return [data + bytes(-len(data) % 4) for data in told]
    values = [recording.series[key] for key in topic.series]
    messages = messages_of(topic, times_ns, values)
    if not topic.silent_at_zero:
        return messages
    is_heard = np.any([column != 0.0 for column in values], axis=0)
    is_heard[1:] |= is_heard[:-1]  # the first zero is told
    return [data if heard else None for data, heard in zip(messages, is_heard.tolist(), strict=True)]


def _health(recording: Recording, time_ns: int) -> bytes:
    """Return what the nodes have to say at the end: how long it took, and what they did other than usual."""
    about = recording.metadata
    plant = PlantReport(
        tick=len(recording.time_s),
        finished=True,
        wall_seconds=about["wall_seconds"],
        missed_ticks=0,
        first_ns=0,
    )
    parts: dict[str, list[HealthPart]] = {PLANT: [HealthReport(ticks=len(recording.time_s)), plant]}
    for event in about["events"]:
        parts.setdefault(event["node"], [])
    for node in list(parts)[1:]:
        told = tuple((event["time_s"], event["what"]) for event in about["events"] if event["node"] == node)
        parts[node] = [HealthReport(announced=told)]
    return pack_diagnostics(
        time_ns,
        [
            Diagnostic(f"{NAMESPACE}/{node}", "", {key: text for part in told for key, text in part.values().items()})
            for node, told in parts.items()
        ],
    )
