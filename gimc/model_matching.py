"""Model matching with a stable filter: fault isolation `min || [0 T] - H [Nd Nf] ||`, and `min || T1 - T2 Q T3 ||`.

Both are solved through `hinfsyn` on a generalised plant whose lower right block is zero: the loop is then open, the
plant stable, and internal stability means that the filter is stable. Each result comes with a lower bound that no
filter, causal or not, can beat.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gimc.checks import real_matrix
from gimc.errors import SynthesisError, UnstableError
from gimc.hinfsyn import HinfResult, hinf_synthesis
from gimc.interconnect import Abcd, Matrix, Response, abcd, append, block_sizes, lft, stack_inputs, state_space
from gimc.norms import frequency_response, hinf_norm, poles, response_function

WEAK = 1e-10  # a direction of a frequency response, relative to the strongest one
ROUNDING = 1e-14  # of a frequency response, relative to its size


@dataclass(frozen=True)
class Matching:
    """A filter and how far it is from the best there is.

    Attributes
    ----------
    filter : control.StateSpace
        Stable H or Q.
    gamma : float
        Norm of the regularised problem (with eps, and rho where there is one), recomputed.
    plain_gamma : float
        Norm of the same problem and filter without the regularisation.
    lower_bound : float
        No filter makes the regularised norm smaller (frequency by frequency, causality ignored).
    plain_lower_bound : float
        The same for the problem without regularisation.
    bound_frequency : float
        Where `lower_bound` is attained (rad/s).
    synthesis : HinfResult
    """

    filter: Any
    gamma: float
    plain_gamma: float
    lower_bound: float
    plain_lower_bound: float
    bound_frequency: float
    synthesis: HinfResult

    @property
    def suboptimality(self) -> float:
        """How far `gamma` may be above the least norm of a *stable* filter: 0.01 is one per cent."""
        return self.gamma / max(self.synthesis.lower_gamma, self.lower_bound, np.finfo(float).tiny) - 1.0


def isolation_filter(Nd: Any, Nf: Any, T: Any, eps: ArrayLike, **options: Any) -> tuple[Any, float]:
    """Stable H with the smallest norm of `[0 T 0] - H [Nd Nf eps I]`: residuals `H (Nd d + Nf f)` that follow `T f`.

    Parameters
    ----------
    Nd : control.StateSpace, p outputs
        From disturbances to the innovation. Scale its inputs to the size of the disturbances.
    Nf : control.StateSpace, p outputs
        From faults to the innovation. With the same A and C as `Nd` both share their states.
    T : control.StateSpace
        Wanted response of the residuals to the faults, stable.
    eps : float or array_like, shape (p,)
        Size of the measurement noise that regularises the problem, in the units of the measurements. Positive.
    **options
        Passed to `hinf_synthesis` (rtol, backoff).

    Returns
    -------
    H : control.StateSpace
        Order at most that of `[Nd Nf]` plus that of `T`.
    gamma : float
        The norm reached, noise included, recomputed.

    Notes
    -----
    The residual signal of the GIMC structure is `f_e = N u - M y = -(Nd d + Nf f)`: apply `-H` to it.
    """
    result = isolation_synthesis(Nd, Nf, T, eps, **options)
    return result.filter, result.gamma


def isolation_synthesis(Nd: Any, Nf: Any, T: Any, eps: ArrayLike, **options: Any) -> Matching:
    """As `isolation_filter`, with lower bounds and the norm without noise."""
    disturbance, fault, target = abcd(Nd, what="Nd"), abcd(Nf, what="Nf"), abcd(T, what="T")
    p, nd = disturbance.D.shape
    nr, nf = target.D.shape
    if fault.D.shape != (p, nf):
        raise ValueError(f"Nf has shape {fault.D.shape}, must be {(p, nf)}: outputs of Nd by inputs of T")
    for name, system in (("Nd", disturbance), ("Nf", fault), ("T", target)):
        _require_stable(name, system)
    plain = _isolation_plant(stack_inputs(disturbance, fault), target, nd)
    matching = model_matching(plain, p, nr, eps=eps, **options)
    names = getattr(Nf, "output_labels", None)
    return matching if names is None else _named(matching, names)


def _isolation_plant(N: Abcd, T: Abcd, nd: int) -> Abcd:
    """`[[0 T -I], [Nd Nf 0]]` with inputs [d, f, r] and outputs [e, y]."""
    p, (nr, nf) = N.D.shape[0], T.D.shape
    both = append(T, N)  # inputs: f for T, then d and f for N
    faults = np.hstack([np.zeros((nf, nd)), np.eye(nf)])
    right = np.vstack([faults, np.eye(nd + nf)])
    B = np.hstack([both.B @ right, np.zeros((both.A.shape[0], nr))])
    D = np.block([[both.D @ right, np.vstack([-np.eye(nr), np.zeros((p, nr))])]])
    return Abcd(both.A, B, both.C, D)


def model_matching(
    P: Any, nmeas: int, ncon: int, *, rho: ArrayLike | None = None, eps: ArrayLike | None = None, **options: Any
) -> Matching:
    """Stable Q with the smallest norm of `P11 + P12 Q P21`, regularised by `rho` and `eps`.

    Parameters
    ----------
    P : control.StateSpace
        Stable generalised plant [[P11, P12], [P21, 0]].
    nmeas, ncon : int
        Numbers of inputs and outputs of Q.
    rho : float or array_like, shape (ncon,), optional
        Penalty on q: rows `diag(rho)` are added under P12. Needed where P12 has no full direct term.
    eps : float or array_like, shape (nmeas,), optional
        Noise on the measurements: columns `diag(eps)` are added beside P21. Needed where P21 has no full direct term.
    **options
        Passed to `hinf_synthesis`.

    Raises
    ------
    SynthesisError
        If P is not stable, the lower right block is not zero, or the synthesis fails.
    """
    plain = abcd(P, what="generalised plant")
    nmeas, ncon = block_sizes(plain, nmeas, ncon)
    regularised = regularise(plain, nmeas, ncon, rho=rho, eps=eps)
    _require_stable("the generalised plant of a model matching problem", plain)
    _require_open_loop(plain, nmeas, ncon)
    synthesis = hinf_synthesis(regularised, nmeas, ncon, **options)
    Q = abcd(synthesis.controller)
    if Q.A.size and poles(Q).real.max() >= 0:
        raise UnstableError(f"the filter found is not stable: pole at {poles(Q).real.max():.3g} rad/s")
    grid = _frequencies(regularised)
    bound, where = matching_lower_bound(regularised, nmeas, ncon, grid)
    plain_bound, _ = matching_lower_bound(plain, nmeas, ncon, grid)
    plain_gamma, _ = hinf_norm(lft(plain, Q, nmeas, ncon))
    return Matching(synthesis.controller, synthesis.gamma, plain_gamma, bound, plain_bound, where, synthesis)


def regularise(P: Abcd, nmeas: int, ncon: int, *, rho: ArrayLike | None = None, eps: ArrayLike | None = None) -> Abcd:
    """Generalised plant with penalties on u and noises on y added: outputs [z, rho u, y], inputs [w, eps noise, u]."""
    A, B, C, D = P
    p1, m1 = D.shape[0] - nmeas, D.shape[1] - ncon
    if rho is not None:
        penalty = np.hstack([np.zeros((ncon, m1)), np.diag(_positive("rho", rho, ncon))])
        C = np.vstack([C[:p1], np.zeros((ncon, A.shape[0])), C[p1:]])
        D = np.vstack([D[:p1], penalty, D[p1:]])
    if eps is not None:
        noise = np.vstack([np.zeros((D.shape[0] - nmeas, nmeas)), np.diag(_positive("eps", eps, nmeas))])
        B = np.hstack([B[:, :m1], np.zeros((A.shape[0], nmeas)), B[:, m1:]])
        D = np.hstack([D[:, :m1], noise, D[:, m1:]])
    return Abcd(A, B, C, D)


def matching_lower_bound(
    P: Any, nmeas: int, ncon: int, frequencies_rad_s: ArrayLike | None = None
) -> tuple[float, float]:
    """Largest over frequency of `min_Q || P11 + P12 Q P21 ||` for a free complex matrix Q: a bound for every filter.

    At one frequency, Parrott's theorem gives the minimum exactly: the larger of the norms of P11 seen by the left null
    space of P12 and by the right null space of P21. Evaluated on a grid and refined around its maximum; every value is
    a valid bound.

    Returns
    -------
    bound, frequency : float
    """
    plant = abcd(P)
    nmeas, ncon = block_sizes(plant, nmeas, ncon)
    p1, m1 = plant.D.shape[0] - nmeas, plant.D.shape[1] - ncon
    respond = response_function(plant)

    def bound(w: Matrix) -> Matrix:
        G = respond(w)
        P11, P12, P21 = G[:, :p1, :m1], G[:, :p1, m1:], G[:, p1:, :m1]
        return np.maximum(_distance(P11, P12), _distance(_adjoint(P11), _adjoint(P21)))

    grid = _frequencies(plant) if frequencies_rad_s is None else np.asarray(frequencies_rad_s, dtype=float)
    return _maximise(bound, grid)


def _distance(G: Response, H: Response) -> Matrix:
    """`min_X || G - H X ||` for each pair of a stack, or less: where H does not tell its range, the best of all ranges.

    Columns of H are equilibrated. A direction weaker than `WEAK` is rounding, or so near to it that it points anywhere;
    yet the smallest entry there is reaches it. With k such directions the distance is at least the singular value
    number k + 1 of what the others leave (Eckart and Young). Those kept point where they should up to rounding over
    their strength, which comes off the bound.
    """
    norms = np.linalg.norm(H, axis=1, keepdims=True)
    U, s, _ = np.linalg.svd(H / np.where(norms > 0, norms, 1.0), full_matrices=False)
    strong = s > WEAK * np.maximum(s[:, :1], 1e-300)
    U = U * strong[:, None, :]
    values = np.linalg.svd(G - U @ (_adjoint(U) @ G), compute_uv=False)
    weakest = np.where(strong, s / np.maximum(s[:, :1], 1e-300), 1.0).min(axis=1, initial=1.0)
    values = np.maximum(values - (ROUNDING / weakest * np.linalg.norm(G, axis=(1, 2)))[:, None], 0.0)
    weak = np.minimum((norms[:, 0] > 0).sum(axis=1), s.shape[1]) - strong.sum(axis=1)
    values = np.hstack([values, np.zeros((len(values), s.shape[1]))])
    return np.asarray(np.take_along_axis(values, np.maximum(weak, 0)[:, None], axis=1)[:, 0])


def _adjoint(G: Response) -> Response:
    return np.conj(np.swapaxes(G, 1, 2))


def _maximise(function: Callable[[Matrix], Matrix], grid: Matrix) -> tuple[float, float]:
    values = function(grid)
    best = int(np.argmax(values))
    value, where = float(values[best]), float(grid[best])
    left, right = float(grid[max(best - 1, 0)]), float(grid[min(best + 1, grid.size - 1)])
    for _ in range(6):
        inner = np.geomspace(left, right, 9)
        values = function(inner)
        best = int(np.argmax(values))
        if values[best] > value:
            value, where = float(values[best]), float(inner[best])
        left, right = float(inner[max(best - 1, 0)]), float(inner[min(best + 1, 8)])
    return value, where


def _frequencies(plant: Abcd) -> Matrix:
    moduli = np.abs(poles(plant))
    moduli = moduli[moduli > 0] if moduli.any() else np.ones(1)
    return np.geomspace(moduli.min() / 100, moduli.max() * 100, 600)


def _require_stable(name: str, system: Abcd) -> None:
    if system.A.size:
        slowest = poles(system).real.max()
        if slowest >= 0:
            raise UnstableError(f"{name} has to be stable: pole with real part {slowest:.3g} rad/s")


def _require_open_loop(P: Abcd, nmeas: int, ncon: int) -> None:
    """Refuse a plant whose measurement sees q, up to rounding: the result would be a feedback law, not a filter."""
    w = _frequencies(P)[::10]
    G = frequency_response(P, w)
    p1, m1 = P.D.shape[0] - nmeas, P.D.shape[1] - ncon
    P12, P21, P22 = G[:, :p1, m1:], G[:, p1:, :m1], G[:, p1:, m1:]
    rows = np.linalg.norm(P21, axis=2, keepdims=True)
    columns = np.linalg.norm(P12, axis=1, keepdims=True)
    if (np.abs(P22) > 1e-6 * np.maximum(rows * np.maximum(columns, 1.0), 1e-300)).any():
        raise SynthesisError(
            "model matching: the block from q to the measurement is not zero; use hinfsyn for a feedback problem"
        )


def _positive(name: str, value: ArrayLike, size: int) -> Matrix:
    array = real_matrix(value, name, "it")
    if array.shape not in ((), (1,), (size,)) or not (array > 0).all():
        raise ValueError(f"{name} = {value!r}: must be positive (one number, or one for each of {size} signals)")
    return np.broadcast_to(array, (size,))


def _named(matching: Matching, inputs: Any) -> Matching:
    return replace(matching, filter=state_space(abcd(matching.filter), inputs=inputs))
