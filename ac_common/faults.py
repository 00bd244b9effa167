"""The faults that the loop knows: what each is called, how large it is given, and where it acts.

A fault is one entry of `FAULTS`. From it come its topics, its key in scenario files, its parameters while a run goes
on, its place in reports and on the live page, and the words for it. How to add one: `docs/how-to/new-fault.md`.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

from ac_common.signals import Command, Measurement
from ac_common.units import KPA, RPM


class Place(Enum):
    """Where a fault is added to the loop."""

    ACTUATOR = "actuator"
    """to a joint of the command, on its way to the plant"""
    SENSOR = "sensor"
    """to a reading, on its way from the plant"""


@dataclass(frozen=True)
class Fault:
    """One kind of fault.

    Attributes
    ----------
    kind : str
        Its name in scenarios, topics, ``fdi/status`` and summaries.
    symbol : str
        As in formulas: ``f_N``.
    place : Place
    signal : str
        The field of `Command` (for an actuator) or `Measurement` (for a sensor) to which it is added.
    unit, si : str, float
        Unit for people, and how much of SI one of it is.
    si_unit : str
    size_key : str
        Key of its size in a scenario file.
    largest : float
        Largest size, also of all faults of this kind together, in `unit`: what nodes take for a signal of this loop.
    typical : float
        A size to begin with, in `unit`.
    name : str
        What is faulty, after "a fault of the".
    subject, verb, more, less : str
        Parts of a sentence: "the compressor", "turn", "faster than commanded", "slower than commanded".
    adds : str
        What a positive size does, for the reference of scenario files.
    has_filter : bool
        Whether a row of the isolation filter H estimates it: only then it can be told from others by its name.
    """

    kind: str
    symbol: str
    place: Place
    signal: str
    unit: str
    si: float
    si_unit: str
    size_key: str
    largest: float
    typical: float
    name: str
    subject: str
    verb: str
    more: str
    less: str
    adds: str
    has_filter: bool

    @property
    def index(self) -> int:
        """Index of the signal to which it is added, in `Command` or `Measurement`."""
        return (Command if self.place is Place.ACTUATOR else Measurement)._fields.index(self.signal)

    @property
    def largest_si(self) -> float:
        """Largest size in SI."""
        return self.largest * self.si

    @property
    def largest_live_si(self) -> float:
        """Largest size of a live fault, SI: `largest_si`, rounded up to two digits so that a parameter is readable."""
        digit = 10.0 ** (math.floor(math.log10(self.largest_si)) - 1)
        return math.ceil(self.largest_si / digit - 1e-9) * digit

    @property
    def size_parameter(self) -> str:
        """Name of a live fault's size among the injector's parameters: ``size_rad_s``."""
        return f"size_{self.si_unit.lower().replace('/', '_')}"

    @property
    def residual_symbol(self) -> str:
        """Symbol of its residual: ``r_N``."""
        return f"r{self.symbol[1:]}"

    @property
    def truth_topic(self) -> str:
        """Topic of what is injected, for evaluation only."""
        return f"fault/{self.kind}"

    @property
    def schedule_topic(self) -> str:
        """Topic of what the scenario wants to be injected."""
        return f"scenario/fault/{self.kind}"

    @property
    def residual_topic(self) -> str:
        """Topic of its estimate, where a filter makes one."""
        return f"fdi/residual/{self.kind}"


#: All faults. Their order is that of every array of faults; those with a filter come in the order of the rows of H.
FAULTS: tuple[Fault, ...] = (
    Fault(
        kind="compressor_speed",
        symbol="f_N",
        place=Place.ACTUATOR,
        signal="compressor",
        unit="rpm",
        si=RPM,
        si_unit="rad/s",
        size_key="size_rpm",
        largest=1000.0,
        typical=40.0,
        name="compressor speed",
        subject="the compressor",
        verb="turn",
        more="faster than commanded",
        less="slower than commanded",
        adds="added to the compressor's speed at the plant",
        has_filter=True,
    ),
    Fault(
        kind="evaporator_pressure",
        symbol="f_p",
        place=Place.SENSOR,
        signal="evaporator_pressure",
        unit="kPa",
        si=KPA,
        si_unit="Pa",
        size_key="size_kpa",
        largest=100.0,
        typical=5.0,
        name="pressure sensor",
        subject="the sensor of the evaporator pressure",
        verb="read",
        more="too high",
        less="too low",
        adds="added to the measured evaporator pressure",
        has_filter=True,
    ),
    Fault(
        kind="superheat_sensor",
        symbol="f_SH",
        place=Place.SENSOR,
        signal="superheat",
        unit="K",
        si=1.0,
        si_unit="K",
        size_key="size_k",
        largest=20.0,
        typical=3.0,
        name="superheat sensor",
        subject="the sensor of the superheat",
        verb="read",
        more="too high",
        less="too low",
        adds="added to the measured superheat",
        has_filter=False,
    ),
)

#: Names of all faults, in their order.
KINDS: tuple[str, ...] = tuple(fault.kind for fault in FAULTS)
#: Those that a filter estimates: in the order of every array of residuals and thresholds.
ISOLABLE: tuple[Fault, ...] = tuple(fault for fault in FAULTS if fault.has_filter)
ISOLABLE_KINDS: tuple[str, ...] = tuple(fault.kind for fault in ISOLABLE)
BY_KIND: dict[str, Fault] = {fault.kind: fault for fault in FAULTS}

#: What a fault is isolated as when it is certainly there and none that a filter is for.
UNKNOWN = "unknown"


def faults_at(place: Place) -> tuple[tuple[int, int], ...]:
    """Return, for each fault at a place, its index in `FAULTS` and that of the signal to which it is added."""
    return tuple((number, fault.index) for number, fault in enumerate(FAULTS) if fault.place is place)


def kinds_in(text: str) -> frozenset[str]:
    """Return the kinds that a list of them names, ``a, b``; other words are passed over."""
    return frozenset(word for part in text.split(",") if (word := part.strip()) in BY_KIND)


def called(kind: str) -> str:
    """Return the words for an isolated fault: "a fault of the pressure sensor"."""
    return "an unknown fault" if kind == UNKNOWN else f"a fault of the {BY_KIND[kind].name}"


def in_unit(kind: str, size_si: float) -> float:
    """Return a size in the fault's unit for people; an unknown fault has none, which is nan."""
    return math.nan if kind == UNKNOWN else size_si / BY_KIND[kind].si


def units(faults: Iterable[Fault]) -> str:
    """Return the SI units of faults in words: "rad/s and Pa"."""
    return " and ".join(dict.fromkeys(fault.si_unit for fault in faults))
