"""The plant at rest, from the cache: finding an equilibrium takes a solver that a running node can do without."""

from ac_common.cache import Arrays, cached, source_fingerprint
from ac_plant_node import parameters_fingerprint


def rest_at(point: str) -> Arrays:
    """Fields `inputs`, `outputs`, `state` and `conserved` of `ac_plant_node.operating_point`.

    Raises
    ------
    ValueError
        For an unknown operating point.
    """

    def find() -> Arrays:
        from ac_plant_node import operating_point

        rest = operating_point(point)
        return {name: getattr(rest, name) for name in ("inputs", "outputs", "state", "conserved")}

    key = {"point": point, "plant": parameters_fingerprint(), "code": source_fingerprint("ac_plant_node")}
    return cached(f"rest-{point}", key, find)
