import numpy as np, math
from gimc_controller_node.controller import Controller
from ac_design import design_controller
from ac_plant_node import operating_point
from ac_common.units import RPM
class KLog:
    """LTI K0 of the medium point in (ln N, alpha)."""
    def __init__(s,point,H=0.1,design=None):
        d=design or design_controller('med',H); s.d=d; n=len(d.phi)
        s.N0=d.command_rest[0]; s.a0=d.command_rest[1]
        op=operating_point(point); s.xi=np.zeros(n)
        at_rest=np.linalg.solve(np.eye(n)-d.phi,d.gamma[:,2:])
        u=np.array([s.to(op.inputs[0]),op.inputs[1]-s.a0])
        s.xi=at_rest@np.linalg.lstsq(d.c@at_rest,u,rcond=None)[0]
        s.last=op.inputs[:2].copy()
        s.stride=d.command_rate*H
    def to(s,N): return s.N0*math.log(max(N,1.0)/s.N0)
    def frm(s,v): return s.N0*math.exp(min(v/s.N0,3.0))
    def step(s,r,y,q):
        d=s.d; e=r-y[:2]
        v=d.c@s.xi+d.d@e
        u=np.array([s.frm(v[0]),v[1]+s.a0])
        lo=np.maximum([40*RPM,0.02],s.last-s.stride); hi=np.minimum(d.command_max,s.last+s.stride)
        u=np.clip(u,lo,hi)
        s.last=u
        dv=np.array([s.to(u[0]),u[1]-s.a0])
        s.xi=d.phi@s.xi+d.gamma[:,:2]@e+d.gamma[:,2:]@dv
        return u.copy()
