"""A test bench in the loop: a plain ROS 2 node that knows nothing of acftc, as a driver in any language would be.

    python examples/own_bench.py --ros-args -r __ns:=/ac             (one terminal)
    acftc run nominal --mode realtime --passive --without ac_plant    (another)

It publishes what the sensors say ten times a second and passes on the latest command. The hardware is made up here:
lags about the medium operating point. K0 bears such a stranger; the compensator, made for another plant, does not,
hence --passive. See docs/how-to/own-plant.md.
"""

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from sensor_msgs.msg import FluidPressure, JointState, Temperature

PERIOD_S = 0.1
QUEUE = 10  # otherwise the defaults: reliable, volatile


class Hardware:
    """Stands in for your input and output channels: each output follows its value at rest with a lag of 8 s."""

    def __init__(self) -> None:
        self.speed, self.opening = 104.72, 0.40  # 1000 rpm, 40 %
        self.pressure, self.superheat, self.wall = 251.2e3, 20.0, 13.99

    def write(self, speed_rad_s: float, opening: float) -> None:
        self.speed, self.opening = speed_rad_s, opening

    def read(self) -> tuple[float, float, float]:
        speed, opening = self.speed - 104.72, self.opening - 0.40
        share = PERIOD_S / 8.0
        self.pressure += share * (251.2e3 - 1210.0 * speed + 280e3 * opening - self.pressure)
        self.superheat += share * (20.0 + 0.237 * speed - 224.0 * opening - self.superheat)
        self.wall += share * (13.99 - 0.006 * speed - 54.8 * opening - self.wall)
        return self.pressure, self.superheat, self.wall


class Bench(Node):
    def __init__(self) -> None:
        super().__init__("my_bench")
        self._hardware = Hardware()
        pressures = ("plant/evaporator_pressure", "plant/condenser_pressure")
        air = ("plant/air_inlet_temperature", "plant/condenser_air_inlet_temperature")
        temperatures = ("plant/superheat", "plant/wall_temperature", *air)
        self._senders = {name: self.create_publisher(FluidPressure, name, QUEUE) for name in pressures}
        self._senders |= {name: self.create_publisher(Temperature, name, QUEUE) for name in temperatures}
        self.create_subscription(JointState, "actuator/command", self._commanded, QUEUE)
        self.create_timer(PERIOD_S, self._tick)

    def _commanded(self, message: JointState) -> None:
        """Names are [compressor, expansion_valve]; a speed travels as velocity, an opening as position."""
        self._hardware.write(message.velocity[0], message.position[1])

    def _tick(self) -> None:
        """All messages of a tick carry the same stamp: by it the other nodes know what belongs together."""
        stamp = self.get_clock().now().to_msg()
        pressure, superheat, wall = self._hardware.read()
        values = {
            "plant/evaporator_pressure": FluidPressure(fluid_pressure=pressure),
            "plant/condenser_pressure": FluidPressure(fluid_pressure=1.31e6),
            "plant/superheat": Temperature(temperature=superheat),
            "plant/wall_temperature": Temperature(temperature=wall),
            "plant/air_inlet_temperature": Temperature(temperature=30.0),
            "plant/condenser_air_inlet_temperature": Temperature(temperature=30.0),
        }
        for name, message in values.items():
            message.header.stamp = stamp
            self._senders[name].publish(message)


def main() -> None:
    rclpy.init()
    node = Bench()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except Exception:
        if rclpy.ok():  # otherwise it was told to end in the middle of a tick
            raise
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
