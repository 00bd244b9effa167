"""The topics of the loop: name, type, frame, joints, who publishes and who subscribes. The one place that knows.

Nothing here imports ROS, so that tools which only read recordings start fast.
"""

from dataclasses import dataclass

NAMESPACE = "/ac"

PRESSURE = "sensor_msgs/msg/FluidPressure"
TEMPERATURE = "sensor_msgs/msg/Temperature"
JOINTS = "sensor_msgs/msg/JointState"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
CLOCK = "rosgraph_msgs/msg/Clock"

COMPRESSOR = "compressor"
VALVE = "expansion_valve"
AIR = "evaporator_air"

#: The field of a JointState in which a joint's value travels: speeds and flows are velocities, openings positions.
JOINT_FIELD = {COMPRESSOR: "velocity", VALVE: "position", AIR: "velocity"}

#: The two faults, in the order of every fault, residual and threshold array.
FAULTS = ("compressor_speed", "evaporator_pressure")

# Names of the nodes, as in `ros2 node list`.
PLANT, INJECTOR, FDI, COMPENSATOR, CONTROLLER = "ac_plant", "fault_injector", "fdi", "compensator", "gimc_controller"
SCENARIO, RECORDER = "scenario", "recorder"
BRINGUP = "bringup"
PAGE = "dash"


#: What the value of a joint can be [rad/s, 0..1, kg/s]: the compressor's 6000 rpm and a fault on top.
JOINT_SPAN = {COMPRESSOR: (0.0, 750.0), VALVE: (0.0, 1.0), AIR: (0.0, 5.0)}
#: What a pressure [Pa] and a temperature [degC, or K for a difference] of this loop can be at all.
PRESSURE_SPAN = (1.0e3, 5.0e6)
TEMPERATURE_SPAN = (-150.0, 200.0)


@dataclass(frozen=True)
class Topic:
    """One topic of the loop, relative to the namespace."""

    name: str
    type: str
    publisher: str
    subscribers: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()  # of a JointState, in the order of the array
    frame: str = ""
    is_difference: bool = False  # its values may have either sign

    @property
    def spans(self) -> tuple[tuple[float, float], ...]:
        """Least and largest value that can be meant, for each of `series`: others are in another unit, or garbage."""
        scalar = {PRESSURE: (PRESSURE_SPAN,), TEMPERATURE: (TEMPERATURE_SPAN,)}
        spans = scalar.get(self.type, tuple(JOINT_SPAN[joint] for joint in self.joints))
        return tuple((-high, high) for _, high in spans) if self.is_difference else spans

    @property
    def series(self) -> tuple[str, ...]:
        """Keys of this topic in a `Recording`: the topic itself, or one key for each joint."""
        if self.type == JOINTS:
            return tuple(f"{self.name}:{joint}" for joint in self.joints)
        return (self.name,) if self.type in (PRESSURE, TEMPERATURE) else ()


_ACTUATORS = (COMPRESSOR, VALVE)

TOPICS: tuple[Topic, ...] = (
    Topic("plant/evaporator_pressure", PRESSURE, PLANT, (INJECTOR, SCENARIO), frame="evaporator"),
    Topic("plant/superheat", TEMPERATURE, PLANT, (INJECTOR,), frame="evaporator"),
    Topic("plant/wall_temperature", TEMPERATURE, PLANT, (INJECTOR,), frame="evaporator"),
    Topic("plant/condenser_pressure", PRESSURE, PLANT, (), frame="condenser"),
    Topic("plant/air_inlet_temperature", TEMPERATURE, PLANT, (FDI,), frame="evaporator_air"),
    Topic("measured/evaporator_pressure", PRESSURE, INJECTOR, (FDI, CONTROLLER), frame="evaporator"),
    Topic("measured/superheat", TEMPERATURE, INJECTOR, (FDI, CONTROLLER), frame="evaporator"),
    Topic("measured/wall_temperature", TEMPERATURE, INJECTOR, (FDI,), frame="evaporator"),
    Topic("reference/evaporator_pressure", PRESSURE, SCENARIO, (COMPENSATOR, CONTROLLER), frame="evaporator"),
    Topic("reference/superheat", TEMPERATURE, SCENARIO, (COMPENSATOR, CONTROLLER), frame="evaporator"),
    Topic("scenario/air", JOINTS, SCENARIO, (PLANT,), (AIR,)),
    Topic("scenario/air_inlet_temperature", TEMPERATURE, SCENARIO, (PLANT,), frame="evaporator_air"),
    Topic("scenario/fault/compressor_speed", JOINTS, SCENARIO, (INJECTOR,), (COMPRESSOR,), is_difference=True),
    Topic(
        "scenario/fault/evaporator_pressure", PRESSURE, SCENARIO, (INJECTOR,), frame="evaporator", is_difference=True
    ),
    Topic("controller/command", JOINTS, CONTROLLER, (INJECTOR, FDI), _ACTUATORS),
    Topic("actuator/command", JOINTS, INJECTOR, (PLANT,), _ACTUATORS),
    Topic("fdi/innovation/evaporator_pressure", PRESSURE, FDI, (COMPENSATOR,), frame="evaporator", is_difference=True),
    Topic("fdi/innovation/superheat", TEMPERATURE, FDI, (COMPENSATOR,), frame="evaporator", is_difference=True),
    Topic("fdi/innovation/wall_temperature", TEMPERATURE, FDI, (COMPENSATOR,), frame="evaporator", is_difference=True),
    Topic("fdi/residual/compressor_speed", JOINTS, FDI, (), (COMPRESSOR,), is_difference=True),
    Topic("fdi/residual/evaporator_pressure", PRESSURE, FDI, (), frame="evaporator", is_difference=True),
    Topic("fdi/status", DIAGNOSTICS, FDI, (COMPENSATOR,)),
    Topic("compensator/q", JOINTS, COMPENSATOR, (CONTROLLER,), _ACTUATORS, is_difference=True),
    Topic("fault/compressor_speed", JOINTS, INJECTOR, (), (COMPRESSOR,), is_difference=True),
    Topic("fault/evaporator_pressure", PRESSURE, INJECTOR, (), frame="evaporator", is_difference=True),
)

#: Topics that are silent while all is well. In no tick anyone waits for them.
OCCASIONAL: tuple[Topic, ...] = (
    # What the actuators hold while no command comes, without f_N: where a controller that comes back takes over.
    Topic("actuator/setpoint", JOINTS, INJECTOR, (CONTROLLER, FDI), _ACTUATORS),
)

BY_NAME = {topic.name: topic for topic in (*TOPICS, *OCCASIONAL)}

#: Keys of `Recording.series`, in the order of the table above.
SERIES: tuple[str, ...] = tuple(key for topic in TOPICS for key in topic.series)
