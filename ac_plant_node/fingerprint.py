"""Strings that change whenever the plant does: keys under which compiled code and designs are cached."""

import hashlib
from pathlib import Path

from ac_plant_node.parameter_file import load_parameters
from ac_plant_node.parameters import Parameters, digest
from ac_plant_node.tables import table_identity

COMPILED_SOURCES = (
    "compiled.py",
    "fingerprint.py",
    "tables.py",
    "parameters.py",
    "inputs.py",
    "dynamics/moist_air.py",
    "dynamics/drive.py",
    "lookup.py",
    "zones.py",
    "dynamics/linear_algebra.py",
    "dynamics/transfer.py",
    "model.py",
    "dynamics/workspace.py",
    "dynamics/exponential.py",
    "integrator.py",
)
"""Files whose text compiled code depends on."""
MODEL_SOURCES = (*COMPILED_SOURCES, "calibration.py", "equilibrium.py", "linear.py")
"""Files whose text equilibria and linear models depend on."""


def source_hash(names: tuple[str, ...]) -> str:
    """Hash of the text of some of this package's files (16 hex digits)."""
    total = hashlib.sha256()
    for name in names:
        total.update((Path(__file__).parent / name).read_bytes())
    return total.hexdigest()[:16]


def parameters_fingerprint(parameters: Parameters | None = None) -> str:
    """Hash of parameters and operating points, the property tables' identity and the model's source (16 hex digits)."""
    parameters = parameters or load_parameters()
    identity = f"{table_identity(parameters.refrigerant)}/{source_hash(MODEL_SOURCES)}"
    return digest(parameters.identity.encode(), identity.encode())[:16]
