"""ac_plant_node."""
