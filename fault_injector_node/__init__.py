"""Fault injection: what the sensors say and what reaches the actuators, with faults and noise added."""

from fault_injector_node.injector import FaultInjector

__all__ = ["FaultInjector"]
