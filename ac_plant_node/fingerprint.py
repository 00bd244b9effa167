"""One string that changes whenever the plant does: the key under which designs are cached."""

from ac_plant_node.parameters import Parameters, digest, load_parameters
from ac_plant_node.tables import table_identity

MODEL_VERSION = 1
"""Raised with every change of the model's equations."""


def parameters_fingerprint(parameters: Parameters | None = None) -> str:
    """Hash of the parameters, the property tables' identity and the version of the model's code (16 hex digits)."""
    parameters = parameters or load_parameters()
    identity = f"{table_identity(parameters.refrigerant)}/model-{MODEL_VERSION}"
    return digest(parameters.array.tobytes(), identity.encode())[:16]
