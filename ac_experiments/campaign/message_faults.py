"""What a message fault does to one message: pure, and the same for the same seed, topic and tick."""

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass

from ac_common.topics import BY_NAME, JOINTS, PRESSURE
from ac_common.units import KPA, RPM
from ac_experiments.campaign.plan import MessageFault

#: The latest that a late message may be, s: more than a tick at 10 Hz.
LATEST_S = 0.15
ICE_POINT_K = 273.15


@dataclass(frozen=True)
class Delivery:
    """One message to be sent, `delay_s` from now."""

    delay_s: float
    values: tuple[float, ...]


def with_faults(
    faults: Sequence[MessageFault], seed: int, topic: str, time_s: float, values: Sequence[float]
) -> list[Delivery]:
    """Return the messages that are to be sent in place of one.

    Parameters
    ----------
    faults
        Of the plan; those that are on at `time_s` act one after the other.
    seed, topic, time_s
        Decide together whether this message is among the share that suffers.
    values
        Of the message, SI.
    """
    sent = [Delivery(0.0, tuple(values))]
    for number, fault in enumerate(faults):
        rng = random.Random(f"{seed} {number} {topic} {time_s:.3f}")
        if not fault.start_s <= time_s < fault.end_s or rng.random() >= fault.share:
            continue
        if fault.kind == "lost":
            return []
        if fault.kind == "late":
            delay_s = rng.uniform(0.0, LATEST_S)
            sent = [Delivery(delivery.delay_s + delay_s, delivery.values) for delivery in sent]
        elif fault.kind == "twice":
            sent = [*sent, *sent]
        else:
            sent = [Delivery(delivery.delay_s, _spoiled(fault.kind, topic, delivery.values)) for delivery in sent]
    return sent


def _spoiled(kind: str, topic: str, values: tuple[float, ...]) -> tuple[float, ...]:
    if kind == "nan":
        return (math.nan,) * len(values)
    if kind == "out_of_range":
        return tuple([1e9 * (1.0 + abs(value)) for value in values])
    type_ = BY_NAME[topic].type
    if type_ == PRESSURE:
        return tuple([value / KPA for value in values])
    if type_ == JOINTS:
        return (values[0] / RPM, *[100.0 * value for value in values[1:]])
    return tuple([value + ICE_POINT_K for value in values])
