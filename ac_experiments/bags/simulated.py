"""The bag of a loop in one process: the messages that the nodes of a lockstep run would have sent, byte by byte."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from ac_common.design_file import ATTACHMENT, to_bytes
from ac_common.errors import RunError
from ac_common.health import HealthPart, HealthReport, PlantReport
from ac_common.topics import BY_NAME, CAR, CLOCK, COMPENSATOR, CONTROLLER, FDI, NAMESPACE, PLANT, TOPICS, Topic
from ac_common.wire import NANOSECONDS, Diagnostic, pack_diagnostics, packer
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
    clock, tick = number_of["/clock"], packer(Topic("clock", CLOCK, "simulated time", PLANT))
    senders = [(number_of[f"{NAMESPACE}/{topic.name}"], _messages(topic, recording)) for topic in _sent(recording)]
    stamps = [round(time_s * NANOSECONDS) for time_s in recording.time_s.tolist()]
    for stamp in stamps:
        bag.write(clock, tick(stamp, ()), stamp, stamp)
        for number, messages in senders:
            if (data := next(messages)) is not None:
                bag.write(number, data, stamp, stamp)
    bag.write(number_of["/diagnostics"], _health(recording, stamps[-1]), stamps[-1], stamps[-1])
    for node, design in ((FDI, designs.fdi), (COMPENSATOR, designs.compensator), (CONTROLLER, designs.controller)):
        bag.attach(ATTACHMENT.format(node), to_bytes(design))
    bag.close()


def _sent(recording: Recording) -> list[Topic]:
    """List the topics on which the run has sent something."""
    topics = (*TOPICS, *CAR) if CAR[0].series[0] in recording.series else TOPICS
    return [topic for topic in topics if topic == BY_NAME["fdi/status"] or topic.series[0] in recording.series]


def _messages(topic: Topic, recording: Recording) -> Iterator[bytes | None]:
    """Give the message of a topic for one tick after the other; None where it is silent."""
    pack = packer(topic)
    stamps = (round(time_s * NANOSECONDS) for time_s in recording.time_s.tolist())
    rows: Sequence[Any]
    if not topic.series:
        rows = [(row,) for row in recording.status]
    else:
        rows = list(zip(*(recording.series[key].tolist() for key in topic.series), strict=True))
    told: Any = None
    for stamp, row in zip(stamps, rows, strict=True):
        is_silent = topic.silent_at_zero and not any(row) and not any(told or ())
        told = row
        yield None if is_silent else _padded(pack(stamp, row))


def _padded(data: bytes) -> bytes:
    """Return a message as the middleware delivers it: a whole number of four bytes."""
    return data + bytes(-len(data) % 4)


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
