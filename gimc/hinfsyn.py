"""H-infinity synthesis for the general four-block problem: Riccati equations of Doyle, Glover, Khargonekar and Francis.

Bisection over the level, a controller a little above the optimum, and the check of the loop that it closes. The form
that the plant is brought to is in `standard_form.py`, the formulas of one level in `central_controller.py`.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gimc.central_controller import ROUTES, Level, Route, central_controller, parrott_bound, solve_level
from gimc.checks import relative_tolerance
from gimc.errors import IllPosedError, InfeasibleError, NormMismatchError, SynthesisError, UnstableError
from gimc.interconnect import Abcd, abcd, block_sizes, lft, state_space
from gimc.norms import hinf_norm, poles, sweep_norm
from gimc.scaling import balance_states
from gimc.standard_form import Standard, standard_form

NORM_TOLERANCE = 1e-3  # agreement asked of claimed and recomputed norms
FLOOR = 1e-7  # levels below this, relative to the signals that add up to z, are not told from zero: they are squared
CANCELLED = 1e-9  # nor has a norm below this, relative to the same, digits to agree on
FAR_BELOW = 1e-6  # relative to the first feasible level: only there the floor is asked for
BACKOFF_LADDER = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0)  # multiples of the back-off tried before giving up


@dataclass(frozen=True)
class HinfResult:
    """What a synthesis found, and how it was checked.

    Attributes
    ----------
    controller : control.StateSpace
        K from measurements to control inputs.
    gamma : float
        H-infinity norm of the closed loop, recomputed from `lft(P, K)` by Hamiltonian bisection.
    frequency : float
        Where it is attained (rad/s).
    swept_gamma : float
        The same norm by an adaptive sweep over frequency.
    claimed_gamma : float
        Level the controller was designed for; `gamma` does not exceed it.
    optimal_gamma : float
        Smallest level found feasible by bisection; `lower_gamma` is the largest one found infeasible.
    lower_gamma : float
    slowest_pole : float
        Largest real part of the closed loop's eigenvalues (rad/s, negative).
    """

    controller: Any
    gamma: float
    frequency: float
    swept_gamma: float
    claimed_gamma: float
    optimal_gamma: float
    lower_gamma: float
    slowest_pole: float


def hinfsyn(
    P: Any,
    nmeas: int,
    ncon: int,
    *,
    rtol: float = 1e-3,
    backoff: float = 5e-3,
    gamma_max: float = 1e12,
) -> tuple[Any, float]:
    """Controller that makes the H-infinity norm of `lft(P, K)` as small as `rtol` and `backoff` say.

    Parameters
    ----------
    P : control.StateSpace
        Generalised plant, inputs [w, u], outputs [z, y].
    nmeas, ncon : int
        Numbers of measurements y (last outputs) and control inputs u (last inputs).
    rtol : float
        Relative width of the bisection's last interval: 1e-12 to 1.
    backoff : float
        The controller is computed for (1 + backoff) times the smallest feasible level. At the optimum itself the
        controller has poles that grow without bound; a few per cent cost little and give a well-behaved controller.
    gamma_max : float
        Largest level to try.

    Returns
    -------
    K : control.StateSpace
        Controller, D_K corrected for D22.
    gamma : float
        H-infinity norm of the closed loop, recomputed.

    Raises
    ------
    SynthesisError
        One subclass for each broken assumption; see `gimc.errors`.
    """
    result = hinf_synthesis(P, nmeas, ncon, rtol=rtol, backoff=backoff, gamma_max=gamma_max)
    return result.controller, result.gamma


def hinf_synthesis(
    P: Any,
    nmeas: int,
    ncon: int,
    *,
    rtol: float = 1e-3,
    backoff: float = 5e-3,
    gamma_max: float = 1e12,
) -> HinfResult:
    """As `hinfsyn`, with everything that is known about the result."""
    plant = abcd(P, what="generalised plant")
    nmeas, ncon = block_sizes(plant, nmeas, ncon)
    _check_options(rtol, backoff, gamma_max)
    standard = standard_form(balance_states(plant), nmeas, ncon)
    best, lower = _bisect(plant, standard, rtol, gamma_max)
    failures = ["no level above the optimum found feasible"]
    for level in _levels(standard, best, backoff):
        try:
            controller = central_controller(standard, level)
            result = _verified(plant, controller, nmeas, ncon, level.gamma, best.gamma, lower)
            return _named(result, P, nmeas, ncon)
        except (NormMismatchError, IllPosedError) as error:
            failures.append(str(error))
    raise NormMismatchError(
        f"no controller near the optimum {best.gamma:.6g} passes the check of its closed loop, tried up to "
        f"{1 + BACKOFF_LADDER[-1] * max(backoff, 1e-3):.3g} times the optimum; last: {failures[-1]}. "
        "Penalise u or the noise on y more, or scale w and z to comparable size"
    )


def _check_options(rtol: float, backoff: float, gamma_max: float) -> None:
    relative_tolerance(rtol, SynthesisError)
    if not 0.0 <= backoff < np.inf:
        raise SynthesisError(f"backoff = {backoff}: must be a finite number, not negative")
    if not 0.0 < gamma_max < np.inf:
        raise SynthesisError(f"gamma_max = {gamma_max}: must be a finite positive number")


def _bisect(plant: Abcd, standard: Standard, rtol: float, gamma_max: float) -> tuple[Level, float]:
    """Smallest feasible level within `rtol`, and the largest infeasible one below it.

    In exact arithmetic every level above the optimum is feasible. Rounding can make one fail, and the bisection then
    stops too high: levels below its end are tried again, and it goes on from the first that is feasible.
    """
    lowest = parrott_bound(standard)
    first = _first_feasible(standard, lowest, gamma_max)
    best, lower, floor = first, lowest, FAR_BELOW * first.gamma
    while True:
        best, lower = _narrow(standard, best, lower, rtol, floor)
        if best.gamma <= floor == FAR_BELOW * first.gamma:
            floor = min(FLOOR * max(_signal_size(plant, standard, first), floor), 0.999 * floor)
            continue
        below = [best.gamma * factor for factor in (0.995, 0.97) if best.gamma * factor > max(lowest, floor)]
        routes: tuple[Route, ...] = (best.route, "hamiltonian")
        again = (solve_level(standard, gamma, route=route) for gamma in below for route in routes)
        found = next((level for level in again if level is not None), None)
        if found is None:
            return best, lower
        best, lower = found, lowest


def _signal_size(plant: Abcd, standard: Standard, level: Level) -> float:
    """Norm from w to the signals that add up to z, with the controller of one level: what rounding of z relates to."""
    _, ncon, _, nmeas = standard.dims
    try:
        return hinf_norm(_split_loop(plant, central_controller(standard, level), nmeas, ncon))[0]
    except (IllPosedError, UnstableError):
        return level.gamma


def _split_loop(plant: Abcd, K: Abcd, nmeas: int, ncon: int) -> Abcd:
    """Closed loop from w to `[C1 x, D12 u, D11 w]`, whose sum is z."""
    A, B, C, D = plant
    p1, m1 = D.shape[0] - nmeas, D.shape[1] - ncon
    C1, D11, D12 = C[:p1], D[:p1, :m1], D[:p1, m1:]
    rows = np.vstack([C1, 0 * C1, 0 * C1, C[p1:]])
    direct = np.block([[0 * D11, 0 * D12], [0 * D11, D12], [D11, 0 * D12], [D[p1:, :m1], D[p1:, m1:]]])
    return lft(Abcd(A, B, rows, direct), K, nmeas, ncon)


def _first_feasible(standard: Standard, lowest: float, gamma_max: float) -> Level:
    for route in ROUTES:
        gamma = min(max(2.0 * lowest, 1.0), gamma_max)
        while gamma > lowest:
            level = solve_level(standard, gamma, route=route)
            if level is not None:
                return level
            if gamma == gamma_max:
                break
            gamma = min(4.0 * gamma, gamma_max)
    raise InfeasibleError(
        f"no stabilising controller with a norm below gamma_max = {gamma_max:.3g} (D11 alone needs {lowest:.3g}); "
        "allow a larger norm, or look for weights of very different size and zeros near the axis"
    )


def _narrow(standard: Standard, best: Level, lower: float, rtol: float, floor: float) -> tuple[Level, float]:
    while best.gamma - lower > rtol * best.gamma and best.gamma > floor:
        middle = float(np.sqrt(max(lower, 1e-3 * best.gamma) * best.gamma))
        level = solve_level(standard, middle, route=best.route)
        if level is None:
            lower = middle
        else:
            best = level
    return best, lower


def _levels(standard: Standard, best: Level, backoff: float) -> Iterator[Level]:
    """Levels to build a controller for: the back-off asked for, then larger ones, each by every route."""
    for factor in BACKOFF_LADDER:
        margin = backoff if factor == 1.0 else max(backoff, 1e-3) * factor
        for route in ROUTES:
            level = solve_level(standard, best.gamma * (1.0 + margin), route=route)
            if level is not None:
                yield level


def _named(result: HinfResult, P: Any, nmeas: int, ncon: int) -> HinfResult:
    """Controller with the signal names that a named plant gives it."""
    inputs, outputs = getattr(P, "output_labels", None), getattr(P, "input_labels", None)
    if inputs is None or outputs is None:
        return result
    named = state_space(abcd(result.controller), inputs=inputs[-nmeas:], outputs=outputs[-ncon:])
    return replace(result, controller=named)


def _verified(plant: Abcd, K: Abcd, nmeas: int, ncon: int, claimed: float, optimal: float, lower: float) -> HinfResult:
    """Close the loop in the caller's units, check stability and the norm by two routes."""
    closed = lft(plant, K, nmeas, ncon)
    slowest = float(poles(closed).real.max()) if closed.A.size else -np.inf
    if slowest >= 0:
        raise NormMismatchError(
            f"closed loop unstable at claimed level {claimed:.6g}: pole with real part {slowest:.3g} rad/s"
        )
    gamma, frequency = hinf_norm(closed)
    swept, _ = sweep_norm(closed)
    if gamma > claimed * (1.0 + NORM_TOLERANCE):
        raise NormMismatchError(f"claimed norm {claimed:.6g}, closed loop has {gamma:.6g} at {frequency:.4g} rad/s")
    differ = abs(swept - gamma) > NORM_TOLERANCE * gamma
    if differ and gamma > CANCELLED * hinf_norm(_split_loop(plant, K, nmeas, ncon))[0]:
        raise NormMismatchError(f"norm {gamma:.6g} by Hamiltonian, {swept:.6g} by frequency sweep")
    return HinfResult(state_space(K), gamma, frequency, swept, claimed, optimal, lower, slowest)
