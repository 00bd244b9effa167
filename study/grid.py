import os; os.environ.setdefault("OPENBLAS_NUM_THREADS","1")
import numpy as np
from ac_plant_node import linearize, operating_point
from ac_plant_node.equilibrium import equilibrium
from ac_common.units import RPM,KPA
from scipy.optimize import root
np.set_printoptions(linewidth=200,precision=3,suppress=True)
def at(p_kpa,sh,t_air,m_air,start):
    op=start
    def eq(z): return equilibrium(np.array([np.exp(z[0]),np.exp(z[1]),m_air,t_air]),start=op.state)
    z0=np.log(op.inputs[:2])
    def err(z):
        try: o=eq(z).outputs
        except Exception: return np.array([10.,10.])
        return (o[:2]-np.array([p_kpa*KPA,sh]))/np.array([5e3,2.5])
    s=root(err,z0,tol=1e-6)
    return eq(s.x) if abs(s.fun).max()<1e-3 else None
if __name__=='__main__':
    med=operating_point('med')
    for p0,start in ((302.2,'low'),(251.2,'med'),(204.6,'high')):
        cur=operating_point(start)
        for T in (25,30,35,40):
            for m in (0.7,1.0,1.4):
                try: e=at(p0,20.0 if T>27 else 18,T,cur.inputs[2]*0+0.1*m if False else operating_point(start).inputs[2]*m,cur)
                except Exception as ex: print(p0,T,m,ex); continue
                if e is None: print(p0,T,m,'none'); continue
                s=linearize(e); G0=s.dcgain()[:, :2]
                G=np.asarray(G0[:2])*np.diag(e.inputs[:2]).diagonal()/np.array([[KPA],[1.]])
                print(p0,T,m,'N %.0f a %.1f'%(e.inputs[0]/RPM,e.inputs[1]*100),'dc d(p,SH)/dln(N,a)',G.ravel(),'p_c %.2f'%(e.outputs[3]/1e6),'slow poles',np.sort(np.linalg.eigvals(s.A).real)[::-1][:4])
