"""A string that changes whenever the plant does: the key under which equilibria and designs are cached."""

from ac_common.cache import source_fingerprint
from ac_plant_node.parameters.file import load_parameters
from ac_plant_node.parameters.values import Parameters, digest
from ac_plant_node.properties.tables import table_identity


def parameters_fingerprint(parameters: Parameters | None = None) -> str:
    """Return a hash of parameters, operating points, the property tables' identity and the sources (16 hex digits)."""
    parameters = parameters or load_parameters()
    identity = f"{table_identity(parameters.refrigerant)}/{source_fingerprint('ac_plant_node')}"
    return digest(parameters.identity.encode(), identity.encode())[:16]
