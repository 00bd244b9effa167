"""The faults that the loop knows: what each is called, how large it is given, and where it acts.

A fault is one entry of `FAULTS`. From it come its topics, its key in scenario files, its parameters while a run goes
on, its place in reports and on the live page, and the words for it. How to add one: `docs/how-to/new-fault.md`.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Any

from ac_common.signals import READINGS, Command
from ac_common.units import KG_H, KPA, PERCENT, RPM


class Place(Enum):
    """Where a fault is added to the loop."""

    ACTUATOR = "actuator"
    """to a joint of the command, on its way to the plant"""
    SENSOR = "sensor"
    """to a reading, on its way from the plant"""
    PLANT = "plant"
    """to nothing: a component of the plant is faulty"""


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
        The field of `Command` (for an actuator) or one of `READINGS` (for a sensor) to which it is added; of the plant
        its kind, which is its joint of ``component/faults``.
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
    is_loss : bool
        Whether its size cannot be negative.
    default : float, optional
        Size in `unit` where a scenario gives none; without it the size is required.
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
    is_loss: bool = False
    default: float | None = None

    @property
    def can_stick(self) -> bool:
        """Whether it is a sensor's, which may also stand still: the profile ``stuck``."""
        return self.place is Place.SENSOR

    @property
    def index(self) -> int:
        """Index of its signal in `Command` or `READINGS`, or, for one of the plant, its own in `COMPONENTS`."""
        if self.place is Place.PLANT:
            return COMPONENTS.index(self)
        return (Command._fields if self.place is Place.ACTUATOR else READINGS).index(self.signal)

    @property
    def lowest(self) -> float:
        """Smallest size, in `unit`."""
        return 0.0 if self.is_loss else -self.largest

    @property
    def lowest_si(self) -> float:
        """Smallest size in SI."""
        return self.lowest * self.si

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
    def lowest_live_si(self) -> float:
        """Smallest size of a live fault, SI."""
        return 0.0 if self.is_loss else -self.largest_live_si

    @property
    def residual_symbol(self) -> str:
        """Symbol of its residual: ``r_N``."""
        return f"r{self.symbol[1:]}"

    @property
    def truth_topic(self) -> str:
        """Topic of what is injected, for evaluation only."""
        return f"fault/{self.kind}"

    @property
    def residual_topic(self) -> str:
        """Topic of its estimate, where a filter makes one."""
        return f"fdi/residual/{self.kind}"


def _component(kind: str, symbol: str, largest: float, typical: float, **words: Any) -> Fault:
    """Return a fault of a component: a share that is lost unless it is said otherwise."""
    share: dict[str, Any] = {
        "unit": "%",
        "si": PERCENT,
        "si_unit": "share",
        "size_key": "size_percent",
        "is_loss": True,
        "less": "",
    }
    about = share | {"place": Place.PLANT, "signal": kind, "has_filter": False} | words
    return Fault(kind=kind, symbol=symbol, largest=largest, typical=typical, **about)


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
    Fault(
        kind="wall_temperature_sensor",
        symbol="f_Tw",
        place=Place.SENSOR,
        signal="wall_temperature",
        unit="K",
        si=1.0,
        si_unit="K",
        size_key="size_k",
        largest=20.0,
        typical=3.0,
        name="wall temperature sensor",
        subject="the sensor of the wall temperature",
        verb="read",
        more="too high",
        less="too low",
        adds="added to the measured wall temperature",
        has_filter=False,
    ),
    Fault(
        kind="condenser_pressure_sensor",
        symbol="f_pc",
        place=Place.SENSOR,
        signal="condenser_pressure",
        unit="kPa",
        si=KPA,
        si_unit="Pa",
        size_key="size_kpa",
        largest=500.0,
        typical=50.0,
        name="condenser pressure sensor",
        subject="the sensor of the condenser pressure",
        verb="read",
        more="too high",
        less="too low",
        adds="added to the measured condenser pressure",
        has_filter=False,
    ),
    _component(
        "valve_offset",
        "f_v",
        100.0,
        5.0,
        name="expansion valve's position",
        subject="the expansion valve",
        verb="open",
        more="more than commanded",
        less="less than commanded",
        adds="added to the opening, up to the stops",
        is_loss=False,
    ),
    _component(
        "compressor_displacement",
        "f_Vd",
        100.0,
        10.0,
        name="compressor's displacement",
        subject="the compressor",
        verb="lose",
        more="of its displacement",
        adds="share of the displacement that is lost",
    ),
    _component(
        "isentropic_efficiency",
        "f_eta",
        50.0,
        10.0,
        name="compressor's isentropic efficiency",
        subject="the compressor",
        verb="lose",
        more="of its isentropic efficiency",
        adds="share of the isentropic efficiency that is lost",
    ),
    _component(
        "refrigerant_leak",
        "f_leak",
        5.0,
        0.5,
        name="refrigerant circuit",
        subject="the refrigerant circuit",
        verb="leak",
        more="behind the condenser",
        adds="refrigerant that leaves behind the condenser, until a fifth of the charge is left",
        unit="kg/h",
        si=KG_H,
        si_unit="kg/s",
        size_key="size_kg_h",
    ),
    _component(
        "condenser_fouling",
        "f_cf",
        100.0,
        30.0,
        name="condenser's surface",
        subject="the condenser",
        verb="lose",
        more="of its air-side conductance",
        adds="share of the condenser's air-side conductance that is lost",
    ),
    _component(
        "condenser_fan",
        "f_fan",
        100.0,
        50.0,
        name="condenser's fan",
        subject="the condenser",
        verb="lose",
        more="of its air flow",
        adds="share of the condenser's air flow that is lost; 0.1 kg/s stay in any case",
        default=100.0,
    ),
    _component(
        "evaporator_fouling",
        "f_ef",
        100.0,
        30.0,
        name="evaporator's surface",
        subject="the evaporator",
        verb="lose",
        more="of its air-side conductance",
        adds="share of the evaporator's air-side conductance that is lost",
    ),
    _component(
        "valve_stuck",
        "f_stuck",
        100.0,
        100.0,
        name="expansion valve's motor",
        subject="the expansion valve",
        verb="stick",
        more="where it is",
        adds="any size above zero: the valve stays where it is",
        default=100.0,
    ),
    _component(
        "valve_slow",
        "f_slow",
        60.0,
        10.0,
        name="expansion valve's speed",
        subject="the expansion valve",
        verb="lag",
        more="behind its command",
        adds="time constant with which the valve follows its command",
        unit="s",
        si=1.0,
        si_unit="s",
        size_key="size_s",
    ),
    Fault(
        kind="air_inlet_sensor",
        symbol="f_Ta",
        place=Place.SENSOR,
        signal="air_inlet_temperature",
        unit="K",
        si=1.0,
        si_unit="K",
        size_key="size_k",
        largest=60.0,
        typical=3.0,
        name="air inlet sensor",
        subject="the sensor of the air's inlet temperature",
        verb="read",
        more="too high",
        less="too low",
        adds="added to the measured inlet air of the evaporator",
        has_filter=False,
    ),
    Fault(
        kind="condenser_air_sensor",
        symbol="f_Tca",
        place=Place.SENSOR,
        signal="condenser_air_inlet_temperature",
        unit="K",
        si=1.0,
        si_unit="K",
        size_key="size_k",
        largest=60.0,
        typical=3.0,
        name="condenser air sensor",
        subject="the sensor of the condenser's inlet air",
        verb="read",
        more="too high",
        less="too low",
        adds="added to the measured inlet air of the condenser",
        has_filter=False,
    ),
)

#: Names of all faults, in their order.
KINDS: tuple[str, ...] = tuple(fault.kind for fault in FAULTS)
#: Those that a filter estimates: in the order of every array of residuals and thresholds.
ISOLABLE: tuple[Fault, ...] = tuple(fault for fault in FAULTS if fault.has_filter)
#: The others.
UNFILTERED: tuple[Fault, ...] = tuple(fault for fault in FAULTS if not fault.has_filter)
ISOLABLE_KINDS: tuple[str, ...] = tuple(fault.kind for fault in ISOLABLE)
#: Those of the plant, in the order of the joints of ``component/faults``: that of `ac_plant_node.inputs.FAULTS`.
COMPONENTS: tuple[Fault, ...] = tuple(fault for fault in FAULTS if fault.place is Place.PLANT)
COMPONENT_KINDS: tuple[str, ...] = tuple(fault.kind for fault in COMPONENTS)
#: Those of sensors that may stand still, in the order of every array that says which do.
STICKING: tuple[Fault, ...] = tuple(fault for fault in FAULTS if fault.can_stick)
#: What says so on ``scenario/faults``: 1 while the reading stays what it was.
STUCK_JOINTS: tuple[str, ...] = tuple(f"{fault.kind}_stuck" for fault in STICKING)
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
