import sys
a,b=int(sys.argv[1]),int(sys.argv[2]); sys.argv=['x','0','0']
from study.drive import *
from study.klog import KLog
from ac_design import ControllerWeights, design_controller
D=design_controller('med',0.1,ControllerWeights(bandwidth_rad_s=(0.8,0.2)))
W=[]
for s in range(a,b):
    d=drive(s); n=d['n']; on=int(900/H)
    L=run(d,controller=KLog(d['point'],design=D)); x=L['x'][300:]; sd=L['sd'][300:]
    z=abs(x[:,14:])/sd[:,2:]
    h=(abs(x[:,14]).max()/RPM,abs(x[:,15]).max()/KPA,z[:,0].max(),z[:,1].max())
    fn=np.where(np.arange(n)>=on,6*RPM,0.0); L=run(d,f_n=fn,controller=KLog(d['point'],design=D)); q=L['x'][on:on+600]; zz=q[:,14]/L['sd'][on:on+600,2]; 
    i=np.argmax(abs(q[:,14])>3.5*RPM)*H; 
    fp=np.where(np.arange(n)>=on,400.0,0.0); L=run(d,f_p=fp,controller=KLog(d['point'],design=D)); q=L['x'][on:on+600]; j=np.argmax(abs(q[:,15])>300)*H
    fn=np.where(np.arange(n)>=on,40*RPM,0.0); L=run(d,f_n=fn,controller=KLog(d['point'],design=D),accommodate=True); q=L['x'][on:]; 
    print(s,d['point'],'healthy fN %.2f fp %.3f z %.1f %.1f'%h,'| 6rpm >3.5 after %.1f | 0.4kPa>0.3 after %.1f |'%(i,j),'40: >6 after %.1f fp max %.2f fN rest %.1f-%.1f'%(np.argmax(q[:,14]>6*RPM)*H,abs(q[:,15]).max()/KPA,q[600:,14].min()/RPM,q[600:,14].max()/RPM),'bad',getattr(L['ob'],'bad',0),flush=True)
