"""The topics of the loop: name, type, meaning, who publishes and who subscribes. The one place that knows.

The topics of faults come from `ac_common.faults`. Nothing here imports ROS, so that tools which only read recordings
start fast. How to add a topic: `docs/how-to/new-topic.md`.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

from ac_common.faults import (
    BY_KIND,
    COMPONENT_KINDS,
    FAULTS,
    ISOLABLE,
    KINDS,
    STUCK_JOINTS,
    Fault,
    Place,
)
from ac_common.signals import READINGS, Cabin, CarSide, Performance

NAMESPACE = "/ac"

PRESSURE = "sensor_msgs/msg/FluidPressure"
TEMPERATURE = "sensor_msgs/msg/Temperature"
HUMIDITY = "sensor_msgs/msg/RelativeHumidity"
JOINTS = "sensor_msgs/msg/JointState"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
CLOCK = "rosgraph_msgs/msg/Clock"

COMPRESSOR = "compressor"
VALVE = "expansion_valve"
AIR = "evaporator_air"
CONDENSER_AIR = "condenser_air"

#: Of each joint: the field of a JointState in which its value travels, its unit, and what that value can be. Speeds and
#: flows are velocities, openings and sizes of faults positions, heat flows and powers efforts; what has no motion in
#: it is a position, too. The compressor's 6000 rpm have a fault on top.
_JOINTS: dict[str, tuple[str, str, tuple[float, float]]] = {
    COMPRESSOR: ("velocity", "rad/s", (0.0, 750.0)),
    VALVE: ("position", "0..1", (0.0, 1.0)),
    AIR: ("velocity", "kg/s", (0.0, 5.0)),
    CONDENSER_AIR: ("velocity", "kg/s", (0.0, 5.0)),
    "cooling": ("effort", "W", (-5.0e4, 5.0e4)),
    "latent_cooling": ("effort", "W", (-5.0e4, 5.0e4)),
    "condensed_water": ("velocity", "kg/s", (0.0, 5.0)),
    "frost": ("velocity", "kg/s", (0.0, 5.0)),
    "compressor_power": ("effort", "W", (-5.0e4, 5.0e4)),
    "vehicle_speed": ("velocity", "m/s", (0.0, 100.0)),
    "sun": ("effort", "W/m2", (0.0, 2000.0)),
    "people": ("position", "persons", (0.0, 100.0)),
    "recirculation": ("position", "0..1", (0.0, 1.0)),
    "belt_speed": ("velocity", "rad/s", (0.0, 750.0)),
    "cabin_air": ("position", "degC", (-150.0, 200.0)),
    "cabin_interior": ("position", "degC", (-150.0, 200.0)),
    "evaporator_humidity": ("position", "0..1", (0.0, 1.0)),
    **{fault.kind: ("position", fault.si_unit, (fault.lowest_live_si, fault.largest_live_si)) for fault in FAULTS},
    **dict.fromkeys(STUCK_JOINTS, ("position", "0 or 1", (0.0, 1.0))),
}
JOINT_FIELD = {joint: field for joint, (field, _, _) in _JOINTS.items()}
JOINT_UNIT = {joint: unit for joint, (_, unit, _) in _JOINTS.items()}
JOINT_SPAN = {joint: span for joint, (_, _, span) in _JOINTS.items()}

# Names of the nodes, as in `ros2 node list`.
PLANT, INJECTOR, FDI, COMPENSATOR, CONTROLLER = "ac_plant", "fault_injector", "fdi", "compensator", "gimc_controller"
SCENARIO, RECORDER = "scenario", "recorder"
BRINGUP = "bringup"
PAGE = "dash"


class Scalar(NamedTuple):
    """A type of message that holds one value: its field, its unit, and what such a value of this loop can be at all."""

    field: str
    unit: str
    span: tuple[float, float]


#: All alike on the wire: header, value, variance. A temperature that is a difference is in K.
SCALARS = {
    PRESSURE: Scalar("fluid_pressure", "Pa", (1.0e3, 5.0e6)),
    TEMPERATURE: Scalar("temperature", "°C", (-150.0, 200.0)),
    HUMIDITY: Scalar("relative_humidity", "0..1", (0.0, 1.0)),
}


@dataclass(frozen=True)
class Topic:
    """One topic of the loop.

    Attributes
    ----------
    name : str
        Relative to the namespace.
    type : str
    meaning : str
        What it says, for the reference.
    publisher : str
        Name of the node that publishes it; names of those that act on it are `subscribers`.
    joints : tuple of str
        Of a JointState, in the order of the array.
    frame : str
    is_difference : bool
        Whether its values may have either sign.
    in_kelvin : bool
        Whether a temperature is a difference in K, and not in degC.
    silent_at_zero : bool
        Whether it has no message in ticks in which it is zero, but for the first of these. Nobody waits for it.
    """

    name: str
    type: str
    meaning: str
    publisher: str
    subscribers: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()
    frame: str = ""
    is_difference: bool = False
    in_kelvin: bool = False
    silent_at_zero: bool = False

    @property
    def unit(self) -> str:
        """Unit of its values, with the joints they belong to where there are several."""
        if self.type == JOINTS:
            named = [f"{joint} {JOINT_UNIT[joint]}" for joint in self.joints]
            return JOINT_UNIT[self.joints[0]] if self.joints in ((AIR,), (CONDENSER_AIR,)) else ", ".join(named)
        if self.in_kelvin:
            return "K"
        return SCALARS[self.type].unit if self.type in SCALARS else "see below"

    @property
    def spans(self) -> tuple[tuple[float, float], ...]:
        """Least and largest value that can be meant, for each of `series`: others are in another unit, or garbage."""
        one = (SCALARS[self.type].span,) if self.type in SCALARS else ()
        spans = one or tuple(JOINT_SPAN[joint] for joint in self.joints)
        return tuple((-high, high) for _, high in spans) if self.is_difference else spans

    @property
    def series(self) -> tuple[str, ...]:
        """Keys of this topic in a `Recording`: the topic itself, or one key for each joint."""
        if self.type == JOINTS:
            return tuple(f"{self.name}:{joint}" for joint in self.joints)
        return (self.name,) if self.type in SCALARS else ()


_ACTUATORS = (COMPRESSOR, VALVE)
_READINGS = {
    "evaporator_pressure": (PRESSURE, "evaporator", "p_e, actual", "p_e with f_p and noise"),
    "superheat": (
        TEMPERATURE,
        "evaporator",
        "superheat SH, actual: a difference",
        "SH with noise; with a derived superheat, also with what f_p does to it",
    ),
    "wall_temperature": (TEMPERATURE, "evaporator", "T_w, wall of the superheated zone, actual", "T_w with noise"),
    "condenser_pressure": (
        PRESSURE,
        "condenser",
        "p_c, actual",
        "p_c with noise; K0's protection uses it, the linear designs do not",
    ),
    "air_inlet_temperature": (
        TEMPERATURE,
        "evaporator_air",
        "air into the evaporator, actual",
        "air into the evaporator, a measured disturbance",
    ),
    "condenser_air_inlet_temperature": (
        TEMPERATURE,
        "condenser_air",
        "air into the condenser, actual",
        "air into the condenser, a measured disturbance that the linear designs do not use",
    ),
}
"""Type and frame of what sensors read, and what its topics ``plant/...`` and ``measured/...`` say."""


def _reading(publisher: str, reading: str, *subscribers: str) -> Topic:
    """Return the topic of what a sensor reads: as it is, from the plant, or as it is read, from the injector."""
    type_, frame, actual, measured = _READINGS[reading]
    name, meaning = (f"plant/{reading}", actual) if publisher == PLANT else (f"measured/{reading}", measured)
    return Topic(name, type_, meaning, publisher, subscribers, frame=frame, in_kelvin=reading == "superheat")


def _of_fault(fault: Fault, name: str, meaning: str, publisher: str, *subscribers: str) -> Topic:
    """Return a topic that carries the size of a fault, in the type of what it is added to."""
    if fault.place is Place.PLANT:
        return Topic(name, JOINTS, meaning, publisher, subscribers, (fault.kind,))
    if fault.place is Place.ACTUATOR:
        return Topic(name, JOINTS, meaning, publisher, subscribers, (fault.signal,), is_difference=True)
    type_, frame, *_ = _READINGS[fault.signal]
    in_kelvin = type_ == TEMPERATURE
    return Topic(name, type_, meaning, publisher, subscribers, (), frame, is_difference=True, in_kelvin=in_kelvin)


def _truth(fault: Fault) -> Topic:
    meaning = f"{fault.symbol}, the truth: for evaluation only, no node of the loop reads it"
    return replace(_of_fault(fault, fault.truth_topic, meaning, INJECTOR), silent_at_zero=not fault.has_filter)


TOPICS: tuple[Topic, ...] = (
    _reading(PLANT, "evaporator_pressure", INJECTOR, SCENARIO),
    *(_reading(PLANT, reading, INJECTOR) for reading in READINGS[1:]),
    Topic(
        "plant/performance",
        JOINTS,
        "heat from the air, that of condensing water, that water, what freezes, compressor power: for evaluation only",
        PLANT,
        joints=Performance._fields[:5],
    ),
    Topic(
        "plant/vent_temperature",
        TEMPERATURE,
        "air behind the evaporator: for evaluation only",
        PLANT,
        frame="evaporator_air",
    ),
    Topic(
        "plant/subcooling",
        TEMPERATURE,
        "subcooling at the condenser's outlet, a difference: for evaluation only",
        PLANT,
        frame="condenser",
        in_kelvin=True,
    ),
    _reading(INJECTOR, "evaporator_pressure", FDI, CONTROLLER),
    _reading(INJECTOR, "superheat", FDI, CONTROLLER),
    _reading(INJECTOR, "wall_temperature", FDI),
    _reading(INJECTOR, "condenser_pressure", CONTROLLER),
    _reading(INJECTOR, "air_inlet_temperature", FDI, CONTROLLER),
    _reading(INJECTOR, "condenser_air_inlet_temperature"),
    Topic(
        "reference/evaporator_pressure",
        PRESSURE,
        "what p_e is to be",
        SCENARIO,
        (COMPENSATOR, CONTROLLER),
        frame="evaporator",
    ),
    Topic(
        "reference/superheat",
        TEMPERATURE,
        "what SH is to be",
        SCENARIO,
        (COMPENSATOR, CONTROLLER),
        frame="evaporator",
        in_kelvin=True,
    ),
    Topic("scenario/air", JOINTS, "air mass flow through the evaporator, kg/s", SCENARIO, (PLANT,), (AIR,)),
    Topic(
        "scenario/air_inlet_temperature",
        TEMPERATURE,
        "its temperature",
        SCENARIO,
        (PLANT,),
        frame="evaporator_air",
    ),
    Topic(
        "scenario/condenser_air",
        JOINTS,
        "air mass flow through the condenser, kg/s",
        SCENARIO,
        (PLANT,),
        (CONDENSER_AIR,),
    ),
    Topic(
        "scenario/condenser_air_inlet_temperature",
        TEMPERATURE,
        "its temperature",
        SCENARIO,
        (PLANT,),
        frame="condenser_air",
    ),
    Topic(
        "scenario/air_humidity",
        HUMIDITY,
        "relative humidity of the air into the evaporator",
        SCENARIO,
        (PLANT,),
        frame="evaporator_air",
    ),
    Topic(
        "scenario/faults",
        JOINTS,
        "sizes of all faults that the scenario wants, and which readings stand still",
        SCENARIO,
        (INJECTOR,),
        (*KINDS, *STUCK_JOINTS),
    ),
    Topic("controller/command", JOINTS, "u, within its limits", CONTROLLER, (INJECTOR, FDI), _ACTUATORS),
    Topic("actuator/command", JOINTS, "what reaches the plant: u with f_N", INJECTOR, (PLANT,), _ACTUATORS),
    Topic(
        "component/faults",
        JOINTS,
        "faults of components that the plant is to have",
        INJECTOR,
        (PLANT,),
        COMPONENT_KINDS,
    ),
    Topic(
        "fdi/innovation/evaporator_pressure",
        PRESSURE,
        "f_e, row of p_e",
        FDI,
        (COMPENSATOR,),
        frame="evaporator",
        is_difference=True,
    ),
    Topic(
        "fdi/innovation/superheat",
        TEMPERATURE,
        "f_e, row of SH: a difference",
        FDI,
        (COMPENSATOR,),
        frame="evaporator",
        is_difference=True,
        in_kelvin=True,
    ),
    Topic(
        "fdi/innovation/wall_temperature",
        TEMPERATURE,
        "f_e, row of T_w: a difference",
        FDI,
        (COMPENSATOR,),
        frame="evaporator",
        is_difference=True,
        in_kelvin=True,
    ),
    *(
        _of_fault(fault, fault.residual_topic, f"{fault.residual_symbol}, the estimate of {fault.symbol}", FDI)
        for fault in ISOLABLE
    ),
    Topic("fdi/status", DIAGNOSTICS, "detected, isolated fault, size, onset, thresholds", FDI, (COMPENSATOR,)),
    Topic("compensator/q", JOINTS, "q = Q f_e", COMPENSATOR, (CONTROLLER,), _ACTUATORS, is_difference=True),
    *map(_truth, FAULTS),
)

#: Topics that have a message in every tick.
TICKED: tuple[Topic, ...] = tuple(topic for topic in TOPICS if not topic.silent_at_zero)

#: Topics that only a run with a car has, in every tick. Without one they are silent, and nobody waits for them.
CAR: tuple[Topic, ...] = (
    Topic(
        "scenario/car",
        JOINTS,
        "vehicle, sun, people, recirculation; compressor speed by the belt, 0 for an electric one",
        SCENARIO,
        (PLANT, CONTROLLER),
        CarSide._fields,
    ),
    Topic(
        "plant/car",
        JOINTS,
        "air and interior of the cabin, humidity at the evaporator, air through the condenser: for evaluation only",
        PLANT,
        joints=Cabin._fields,
    ),
)

#: Topics that are silent in some runs, or while all is well. In no tick of those anyone waits for them.
OCCASIONAL: tuple[Topic, ...] = (
    *CAR,
    Topic(
        "actuator/setpoint",
        JOINTS,
        "what the actuators hold while no command comes, without f_N",
        INJECTOR,
        (CONTROLLER, FDI),
        _ACTUATORS,
    ),
)

#: Topics of the fields of `ac_common.signals.AirSide`, in their order.
AIR_SIDE: tuple[str, ...] = (
    "scenario/air",
    "scenario/air_inlet_temperature",
    "scenario/condenser_air",
    "scenario/condenser_air_inlet_temperature",
    "scenario/air_humidity",
)

BY_NAME = {topic.name: topic for topic in (*TOPICS, *OCCASIONAL)}

#: Keys of `Recording.series`, in the order of the table above.
SERIES: tuple[str, ...] = tuple(key for topic in TOPICS for key in topic.series)
#: Those that a run with a car has besides: what is played to the car, and what comes of it.
CAR_SERIES: tuple[str, ...] = BY_NAME["scenario/car"].series
CABIN_SERIES: tuple[str, ...] = BY_NAME["plant/car"].series


#: Who acts on a topic, where that is somebody else with the designs of the whole envelope.
WITH_ENVELOPE: dict[str, tuple[str, ...]] = {
    "measured/condenser_air_inlet_temperature": (FDI,),
    **dict.fromkeys(("measured/evaporator_pressure", "measured/superheat"), (FDI, COMPENSATOR, CONTROLLER)),
    "measured/condenser_pressure": (FDI, COMPENSATOR, CONTROLLER),
    "controller/command": (INJECTOR, FDI, COMPENSATOR),
    **{topic.name: () for topic in TOPICS if topic.name.startswith("fdi/innovation/")},
    **{fault.residual_topic: (COMPENSATOR,) for fault in ISOLABLE},
}


AIR_FLOW = "scenario/air"
"""The blower's air flow, which the observer of `air_flow_sensor: blower` is told."""


def topics_in(in_car: bool, design: str, air_flow_sensor: str = "none") -> tuple[Topic, ...]:
    """Return the topics of a run: in a car or not, with designs "paper" or "envelope", the blower "none" or known."""
    topics, others = (*TOPICS, *CAR) if in_car else TOPICS, {} if design == "paper" else dict(WITH_ENVELOPE)
    if air_flow_sensor != "none":
        others[AIR_FLOW] = (PLANT, FDI)
    return tuple(replace(topic, subscribers=others.get(topic.name, topic.subscribers)) for topic in topics)


#: Keys in `SERIES` of the fields of `ac_common.signals.Performance`, in their order.
PERFORMANCE_SERIES: tuple[str, ...] = (
    *BY_NAME["plant/performance"].series,
    "plant/vent_temperature",
    "plant/subcooling",
)


def truth_of(kind: str) -> str:
    """Return the key in `SERIES` of a fault as it was injected."""
    return BY_NAME[BY_KIND[kind].truth_topic].series[0]


def schedule_of(kind: str) -> str:
    """Return the key in `SERIES` of a fault as the scenario wants it; also of one of `STUCK_JOINTS`."""
    return f"scenario/faults:{kind}"


def residual_of(kind: str) -> str:
    """Return the key in `SERIES` of the estimate of a fault that has a filter."""
    return BY_NAME[BY_KIND[kind].residual_topic].series[0]
