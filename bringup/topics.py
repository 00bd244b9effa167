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


@dataclass(frozen=True)
class Topic:
    """One topic of the loop, relative to the namespace."""

    name: str
    type: str
    publisher: str
    subscribers: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()  # of a JointState, in the order of the array
    frame: str = ""

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
    Topic("reference/evaporator_pressure", PRESSURE, SCENARIO, (CONTROLLER,), frame="evaporator"),
    Topic("reference/superheat", TEMPERATURE, SCENARIO, (CONTROLLER,), frame="evaporator"),
    Topic("scenario/air", JOINTS, SCENARIO, (PLANT,), (AIR,)),
    Topic("scenario/air_inlet_temperature", TEMPERATURE, SCENARIO, (PLANT,), frame="evaporator_air"),
    Topic("scenario/fault/compressor_speed", JOINTS, SCENARIO, (INJECTOR,), (COMPRESSOR,)),
    Topic("scenario/fault/evaporator_pressure", PRESSURE, SCENARIO, (INJECTOR,), frame="evaporator"),
    Topic("controller/command", JOINTS, CONTROLLER, (INJECTOR, FDI), _ACTUATORS),
    Topic("actuator/command", JOINTS, INJECTOR, (PLANT,), _ACTUATORS),
    Topic("fdi/innovation/evaporator_pressure", PRESSURE, FDI, (COMPENSATOR,), frame="evaporator"),
    Topic("fdi/innovation/superheat", TEMPERATURE, FDI, (COMPENSATOR,), frame="evaporator"),
    Topic("fdi/innovation/wall_temperature", TEMPERATURE, FDI, (COMPENSATOR,), frame="evaporator"),
    Topic("fdi/residual/compressor_speed", JOINTS, FDI, (), (COMPRESSOR,)),
    Topic("fdi/residual/evaporator_pressure", PRESSURE, FDI, (), frame="evaporator"),
    Topic("fdi/status", DIAGNOSTICS, FDI, (COMPENSATOR,)),
    Topic("compensator/q", JOINTS, COMPENSATOR, (CONTROLLER,), _ACTUATORS),
    Topic("fault/compressor_speed", JOINTS, INJECTOR, (), (COMPRESSOR,)),
    Topic("fault/evaporator_pressure", PRESSURE, INJECTOR, (), frame="evaporator"),
)

BY_NAME = {topic.name: topic for topic in TOPICS}

#: Keys of `Recording.series`, in the order of the table above.
SERIES: tuple[str, ...] = tuple(key for topic in TOPICS for key in topic.series)
