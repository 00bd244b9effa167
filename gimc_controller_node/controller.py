"""K0 at run time: `u = V~^-1 (U~ (r - y) + q)`, one step a tick.

U~ and V~ - I share their state matrix, so both run as one filter with the state `xi` (reading `u` back, as the GIMC
structure does, instead of inverting V~):

    u_k      = C_k xi_k + D_k (r_k - y_k) + q_k
    xi_{k+1} = Phi xi_k + Gamma_e (r_k - y_k) - Gamma_u u_k

What is read back is the command after its limits: the states then stay consistent with what the plant really gets,
which is the anti-windup of this form.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fdi_node.cache import Arrays

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class ControllerDesign:
    """Sampled U~ and V~ of one operating point, in deviations from it.

    Attributes
    ----------
    phi : ndarray, shape (n, n)
        State matrix of U~ and V~.
    gamma : ndarray, shape (n, 4)
        Input matrix: columns of `r - y` [Pa, K], then of `u` [rad/s, 0..1] (with the sign of V~'s read-back included).
    c : ndarray, shape (2, n)
    d : ndarray, shape (2, 2)
        Direct feedthrough of U~.
    command_rest : ndarray, shape (2,)
        Command at the operating point [rad/s, 0..1].
    command_min, command_max : ndarray, shape (2,)
        Limits of the command [rad/s, 0..1].
    sample_time_s : float
    """

    phi: Vector
    gamma: Vector
    c: Vector
    d: Vector
    command_rest: Vector
    command_min: Vector
    command_max: Vector
    sample_time_s: float

    @classmethod
    def from_arrays(cls, arrays: Arrays) -> "ControllerDesign":
        """Design from the arrays that the cache stores."""
        matrices = {name: np.ascontiguousarray(arrays[name]) for name in cls.__dataclass_fields__}
        return cls(**{**matrices, "sample_time_s": float(arrays["sample_time_s"])})  # type: ignore[arg-type]


class Controller:
    """The controller's state and its step."""

    def __init__(self, design: ControllerDesign) -> None:
        self.design = design
        self._state = np.zeros(len(design.phi))
        self._inputs = np.zeros(4)

    def step(self, reference: Vector, measured: Vector, q: Vector) -> Vector:
        """Command of this tick.

        Parameters
        ----------
        reference : ndarray, shape (2,)
            Evaporator pressure [Pa] and superheat [K] wanted.
        measured : ndarray, shape (2,) or longer
            The same two, as measured; what follows is not used.
        q : ndarray, shape (2,)
            The compensator's signal [rad/s, 0..1].

        Returns
        -------
        ndarray, shape (2,)
            Compressor speed [rad/s] and valve opening [0..1], within their limits.
        """
        design = self.design
        error = reference - measured[:2]
        wanted = design.c @ self._state + design.d @ error + q + design.command_rest
        command: Vector = np.minimum(np.maximum(wanted, design.command_min), design.command_max)
        self._inputs[:2] = error
        self._inputs[2:] = command - design.command_rest
        self._state = design.phi @ self._state + design.gamma @ self._inputs
        return command
