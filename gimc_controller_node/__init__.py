"""gimc_controller_node."""
