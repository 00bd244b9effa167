"""The plant at rest, from the cache, so that a node needs no solver for equilibria."""

import contextlib

from ac_common.cache import Arrays, cached, compiled_folder, source_fingerprint
from ac_plant_node.compiled_sources import COMPILED_SOURCES
from ac_plant_node.fingerprint import parameters_fingerprint


def rest_at(point: str) -> Arrays:
    """Return the fields `inputs`, `outputs`, `state` and `conserved` of `ac_plant_node.operating_point`.

    `inputs` are all those of `ac_plant_node.inputs.INPUTS`, (7,).

    Raises
    ------
    ValueError
        For an unknown operating point.
    """

    def find() -> Arrays:
        from ac_plant_node.dynamics.drive import held_inputs
        from ac_plant_node.equilibrium import operating_point
        from ac_plant_node.inputs import N_INPUTS
        from ac_plant_node.parameters.file import load_parameters

        rest = operating_point(point)
        inputs = held_inputs(rest.inputs, load_parameters())[:N_INPUTS]
        return {"inputs": inputs, **{name: getattr(rest, name) for name in ("outputs", "state", "conserved")}}

    key = {"point": point, "plant": parameters_fingerprint(), "code": source_fingerprint("ac_plant_node")}
    return cached(f"rest-{point}", key, find)


def prepare(point: str) -> None:
    """Put equilibrium and compiled code into the cache, which takes up to a minute; nodes then load them at once.

    Raises
    ------
    ValueError
        For an unknown operating point.
    """
    rest_at(point)
    done = compiled_folder(*COMPILED_SOURCES) / "complete"
    if done.exists():
        return
    from ac_plant_node.plant import Plant

    plant = Plant.at(point)
    plant.advance(1.0)
    with contextlib.suppress(OSError):  # a cache that cannot be written costs time, and nothing else
        done.touch()
