import sys; sys.argv=['x','0','0']
from study.drive import *
from study.klog import KLog
from ac_design import ControllerWeights, design_controller
base={}
for s in range(0,14):
    d=drive(s); L=run(d); e=abs(L['y'][:,:2]-L['ref']); base[s]=(e[:,0].sum(),e[:,1].sum())
from dataclasses import replace
for bw,cmd in (((0.3,0.1),(0.05,0.1)),((0.8,0.2),(0.05,0.1)),((0.8,0.2),(0.02,0.04)),((1.5,0.3),(0.02,0.04)),((1.5,0.4),(0.01,0.02))):
    try: D=design_controller('med',0.1,ControllerWeights(bandwidth_rad_s=bw,command=cmd))
    except Exception as ex: print(bw,cmd,ex); continue
    R=[];mx=[]
    for s in range(0,14):
        d=drive(s); L=run(d,controller=KLog(d['point'],design=D)); e=abs(L['y'][:,:2]-L['ref'])
        R.append((e[:,0].sum()/base[s][0],e[:,1].sum()/base[s][1])); mx.append((e[:,0].max()/KPA,e[:,1].max(),np.abs(np.diff(L['u'][:,0])).mean()/RPM,L['y'][:,1].min(),abs(L['x'][300:,14]).max()/RPM))
    R=np.array(R); print(bw,cmd,'mean ratio',R.mean(0),'max',R.max(0),'max err',np.array(mx).max(0),'min SH',np.array(mx)[:,3].min(),flush=True)
