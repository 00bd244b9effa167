"""What the plant's compiled code is made of: a change in any of it compiles all anew (see `ac_common.compiled`)."""

COMPILED_SOURCES = (
    "ac_plant_node.inputs",
    "ac_plant_node.properties",
    "ac_plant_node.parameters",
    "ac_plant_node.dynamics",
)
"""Packages and modules whose functions are compiled into one another, or whose constants are compiled in."""
