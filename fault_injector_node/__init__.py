"""fault_injector_node."""
