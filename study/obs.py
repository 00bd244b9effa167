import numpy as np
from ac_plant_node.dynamics import integrator as I
from ac_plant_node.dynamics import balances as B
from ac_plant_node.properties.compiled import jit
from ac_plant_node.parameters.values import INDEX
from ac_plant_node.dynamics.balances import P_E, SUPERHEAT, WALL_E2, P_C, N_AUX

CMA, CUA, EXP = INDEX["condenser_air_kg_s"], INDEX["condenser_air_ua_w_k"], INDEX["air_ua_exponent"]
NY = 12
NX = 16  # y12, mu_e, mu_c, f_N, f_p
MU_E, MU_C, F_N, F_P = 12, 13, 14, 15
SC = np.array([1e-2, 1e3, 1e5, 5.0, 5.0, 1e5, 1e4, 0.1, 1e5, 5.0, 5.0, 5.0, 0.1, 0.1, 4.0, 1e3])
OSC = np.array([1e3, 1.0, 1.0, 1e4])
DIFF = np.array([1e-8, 1e-3, 1e-1, 1e-5, 1e-5, 1.0, 1e-3, 1e-7, 1e-1, 1e-5, 1e-5, 1e-5])*30

@jit
def eval_(k, y, w, par, tab, mu_e, mu_c, f_n, cma0, cua0, dy, out):
    k.held[0] = w[0] + f_n
    k.held[1] = w[1]
    k.held[2] = w[2] * np.exp(mu_e)
    k.held[3] = w[3]
    for i in range(4):
        k.held[i] = min(max(k.held[i], B.INPUT_LOW[i]), B.INPUT_HIGH[i])
    par[CMA] = cma0 * np.exp(mu_c)
    par[CUA] = cua0 * np.exp(mu_c * par[EXP])
    st = I._rate(k, y, dy, par, tab)
    out[0], out[1], out[2], out[3] = k.aux[P_E], k.aux[SUPERHEAT], k.aux[WALL_E2] - 273.15, k.aux[P_C]
    return st

@jit
def jac(k, y, x, w, par, tab, cma0, cua0, A, C, D):
    """A (16,16) continuous, C (4,16), scaled coordinates; central differences with steps D (scaled)"""
    dy0 = np.zeros(12); dy1 = np.zeros(12); o0 = np.zeros(4); o1 = np.zeros(4); t = np.zeros(12)
    A[:] = 0.0; C[:] = 0.0
    g0, g1 = k.guess[0], k.guess[1]
    for j in range(15):
        if j == 5: continue
        d = D[j]*SC[j]
        ok = 0
        for sgn in range(2):
            for i in range(12): t[i] = y[i]
            me, mc, fn = x[MU_E], x[MU_C], x[F_N]
            dd = d if sgn == 0 else -d
            if j < 12: t[j] += dd
            elif j == 12: me += dd
            elif j == 13: mc += dd
            else: fn += dd
            k.guess[0], k.guess[1] = g0, g1
            if sgn == 0: ok += eval_(k, t, w, par, tab, me, mc, fn, cma0, cua0, dy0, o0)
            else: ok += eval_(k, t, w, par, tab, me, mc, fn, cma0, cua0, dy1, o1)
        if ok != 0: continue
        for i in range(12):
            if i != 5: A[i, j] = (dy0[i] - dy1[i]) / (2*d) * SC[j] / SC[i]
        for i in range(4): C[i, j] = (o0[i] - o1[i]) / (2*d) * SC[j] / OSC[i]
    k.guess[0], k.guess[1] = g0, g1
    C[0, F_P] = SC[F_P] / OSC[0]
    return 0

@jit
def expm(A, h, E):
    n = A.shape[0]
    M = A * h
    norm = 0.0
    for i in range(n):
        s = 0.0
        for j in range(n): s += abs(M[i, j])
        norm = max(norm, s)
    q = 0
    while norm > 0.5 * 2.0**q: q += 1
    M = M / 2.0**q
    E[:] = np.eye(n)
    T = np.eye(n)
    for m in range(1, 10):
        T = T @ M / m
        E[:] = E + T
    for _ in range(q):
        E[:] = E @ E

@jit
def predict(work, x, w, par, tab, cma0, cua0, h, Phi, P, Q, out):
    u = np.empty(4)
    u[0] = w[0] + x[F_N]; u[1] = w[1]; u[2] = w[2]*np.exp(x[MU_E]); u[3] = w[3]
    par[CMA] = cma0 * np.exp(x[MU_C]); par[CUA] = cua0 * np.exp(x[MU_C]*par[EXP])
    st = I.run(work, par, tab, u, h, out)
    P[:] = Phi @ P @ Phi.T
    for i in range(P.shape[0]): P[i, i] += Q[i] * h
    return st

@jit
def update(work, x, P, C, R, e, used, dx, nis):
    """sequential scalar updates, e: innovation scaled; returns correction dx (scaled)"""
    n = P.shape[0]
    dx[:] = 0.0
    K = np.empty(n)
    for m in range(4):
        if not used[m]: continue
        s = R[m]
        r = e[m]
        for i in range(n):
            a = 0.0
            for j in range(n): a += P[i, j] * C[m, j]
            K[i] = a
        for i in range(n):
            s += C[m, i] * K[i]
            r -= C[m, i] * dx[i]
        nis[m] = r / np.sqrt(s)
        for i in range(n): dx[i] += K[i] / s * r
        for i in range(n):
            for j in range(n): P[i, j] -= K[i] * K[j] / s
    for i in range(n):
        for j in range(i):
            v = 0.5 * (P[i, j] + P[j, i]); P[i, j] = v; P[j, i] = v

@jit
def correct(work, x, dx):
    k = I.views(work)
    for i in range(12):
        if i != 5: k.y[i] += dx[i] * SC[i]
    for i in range(12, 16): x[i] += dx[i] * SC[i]
    k.held[0] = np.nan
