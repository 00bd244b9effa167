import os; os.environ.setdefault("OPENBLAS_NUM_THREADS","1")
import numpy as np, sys, time
sys.path.insert(0,'.')
from ac_common.units import RPM, KPA
from ac_plant_node import Plant, operating_point, load_parameters
from ac_plant_node.dynamics import integrator as I
from ac_plant_node.properties.tables import load_tables
from ac_design import design_controller
from gimc_controller_node.controller import Controller
from study import obs as O

H=0.1
STD=np.array([200.0,0.1,0.05,2000.0])
def drive(seed, T=1500.0):
    rng=np.random.default_rng(seed)
    n=int(T/H); t=np.arange(n)*H
    point=rng.choice(["low","med","high"])
    op=operating_point(point)
    def ramps(lo,hi,start,step=(60,200),ramp=(20,150)):
        v=np.full(n,start); now=0.0; cur=start
        while True:
            now+=rng.uniform(*step)
            if now>=T: break
            new=rng.uniform(lo,hi); d=rng.uniform(*ramp)
            i=int(now/H); m=int(d/H); seg=np.linspace(cur,new,m)
            e=min(n,i+m); v[i:e]=seg[:e-i]; v[e:]=new; cur=new; now+=d
        return v
    def steps(lo,hi,step=(60,200),log=False):
        v=np.ones(n); now=0.0
        while True:
            now+=rng.uniform(*step)
            if now>=T: break
            v[int(now/H):]=1+rng.uniform(lo,hi)
        return v
    air_t=ramps(20,43,op.inputs[3])
    blow=steps(-0.35,0.45)
    cond=1+ramps(-0.5,1.0,0.0,step=(10,80),ramp=(3,30))
    cond_t=ramps(20,45,30.0)
    p0,sh0=op.outputs[:2]
    pref=ramps(205e3,300e3,p0,ramp=(10,60)); 
    shref=sh0+ramps(-8,4,0.0,ramp=(10,60))
    return dict(point=point,n=n,air_t=air_t,m_e=op.inputs[2]*blow,blow=blow,cond=cond,cond_t=cond_t,pref=pref,shref=shref,seed=seed)

class Obs:
    def __init__(s,point,sens=(1,1,1,1),q_mu=0.06,q_muc=0.1,q_n=0.3*RPM,q_p=20.0,jump=8.0,par=None):
        op=operating_point(point)
        s.par=(load_parameters().array.copy() if par is None else par.copy()); s.tab=load_tables()
        s.cma0=s.par[O.CMA]; s.cua0=s.par[O.CUA]
        s.x=np.zeros(16); s.m0=op.inputs[2]
        s.work=I.new_work(op.conserved,1e-5); s.k=I.views(s.work)
        s.A=np.zeros((16,16)); s.C=np.zeros((4,16)); s.Phi=np.eye(16)
        s.Q=np.zeros(16); 
        s.Q[:12]=(np.array([1e-5,5.,20.,0.003,0.002,0,50.,2e-4,20.,0.003,0.002,0.002])/O.SC[:12])**2
        s.Q[:12]*=0.1**2; s.Q[12]=(q_mu/O.SC[12])**2; s.Q[13]=(q_muc/O.SC[13])**2; s.Q[14]=(q_n/O.SC[14])**2; s.Q[15]=(q_p/O.SC[15])**2
        s.P=np.diag(s.Q)*1.0
        s.P[12,12]=0.05**2; s.P[13,13]=0.05**2; 
        s.R=(STD/O.OSC)**2; s.used=np.array(sens,dtype=np.bool_)
        s.out=op.outputs.copy().astype(float); s.tick=0; s.nis=np.zeros(4); s.dx=np.zeros(16); s.jump=jump
        s.jumps=0; s.dscale=0.05; s.every=10
    def step_update(s,y,w,cond_t):
        """measurement y(4); w: [N_cmd prev, alpha prev, m0, T_air] for linearisation"""
        s.par[O.I_CTA]=cond_t+273.15
        if s.tick%s.every==0:
            O.jac(s.k,s.k.y.copy(),s.x,w,s.par,s.tab,s.cma0,s.cua0,s.A,s.C,np.maximum(s.dscale*np.sqrt(np.diag(s.P)),1e-7))
            O.expm(s.A,H,s.Phi)
            s.k.held[0]=np.nan
        s.tick+=1
        pred=s.out.copy(); pred[0]+=s.x[O.F_P]
        e=(y-pred)/O.OSC
        s.e=e
        # jump
        if s.jump and s.used[0]:
            S=s.C@s.P@s.C.T+np.diag(s.R)
            z=e/np.sqrt(np.diag(S))
            if abs(z[0])>s.jump and max(abs(z[1]),abs(z[2]))<5:
                s.P[15,15]+=(2*e[0]*O.OSC[0]/O.SC[15])**2; s.jumps+=1
        O.update(s.work,s.x,s.P,s.C,s.R,e,s.used,s.dx,s.nis)
        s.back=s.k.y.copy(); xb=s.x.copy()
        O.correct(s.work,s.x,s.dx)
        return s.x
    def predict(s,w,cond_t):
        s.par[O.I_CTA]=cond_t+273.15
        st=O.predict(s.work,s.x,w,s.par,s.tab,s.cma0,s.cua0,H,s.Phi,s.P,s.Q,s.out)
        if st: 
            s.bad=getattr(s,'bad',0)+1
            s.k.y[:]=s.back; s.k.held[0]=np.nan
        return st
from ac_plant_node.parameters.values import INDEX
O.I_CTA=INDEX["condenser_air_inlet_k"]

def run(d,f_n=None,f_p=None,obs=None,accommodate=False,noise=True,par=None,controller=None,sens=(1,1,1,1)):
    n=d['n']; point=d['point']; op=operating_point(point)
    par_p=(load_parameters().array.copy() if par is None else par.copy()); tab=load_tables(); work=I.new_work(op.conserved,1e-5)
    c0,u0=par_p[O.CMA],par_p[O.CUA]
    K=controller or Controller(design_controller(point,H))
    rng=np.random.default_rng(d['seed']+10**6)
    ns=rng.normal(size=(n,4))*STD*(1 if noise else 0)
    ob=obs or Obs(point,sens=sens)
    y=op.outputs.astype(float).copy(); out=y.copy()
    L=dict(y=np.empty((n,4)),x=np.empty((n,16)),u=np.empty((n,2)),sd=np.empty((n,4)),e=np.empty((n,4)),nis=np.empty((n,4)),ref=np.empty((n,2)))
    u=op.inputs[:2].copy()
    tobs=0; tpl=0
    ui=np.empty(4)
    for k in range(n):
        fn=f_n[k] if f_n is not None else 0.0; fp=f_p[k] if f_p is not None else 0.0
        ym=out+ns[k]; ym[0]+=fp
        ti=d['air_t'][k]; tc=d['cond_t'][k]
        w=np.array([u[0],u[1],ob.m0,ti])
        a=time.perf_counter()
        x=ob.step_update(ym,w,tc)
        tobs+=time.perf_counter()-a
        r=np.array([d['pref'][k],d['shref'][k]])
        if accommodate:
            u=K.step(r,np.array([ym[0]-x[15],ym[1]]),None) - np.array([0,0])
            uc=u.copy(); uc[0]-=x[14]
        else:
            u=K.step(r,ym[:2],None); uc=u
        u=uc
        L['y'][k]=out; L['x'][k]=x; L['u'][k]=u; L['sd'][k]=np.sqrt(np.diag(ob.P)[12:])*O.SC[12:]; L['e'][k]=ob.e*O.OSC; L['nis'][k]=ob.nis; L['ref'][k]=r
        a=time.perf_counter()
        ob.predict(np.array([u[0],u[1],ob.m0,ti]),tc)
        tobs+=time.perf_counter()-a
        ui[:]=[u[0]+fn,u[1],d['m_e'][k],ti]
        par_p[O.CMA]=c0*d['cond'][k]; par_p[O.CUA]=u0*d['cond'][k]**par_p[O.EXP]; par_p[O.I_CTA]=tc+273.15
        a=time.perf_counter()
        st=I.run(work,par_p,tab,ui,H,out)
        tpl+=time.perf_counter()-a
        if st: print('plant left',k); break
    L['t']=(tobs,tpl); L['ob']=ob
    return L
if __name__=='__main__':
    seeds=range(int(sys.argv[1]),int(sys.argv[2]))
    for s in seeds:
        d=drive(s); n=d['n']
        L=run(d)
        i=int(30/H)
        x=L['x'][i:]
        print(s,d['point'],'healthy f_N max %.2f rpm f_p max %.3f kPa mu_e err %.3f sd_N %.2f-%.2f sd_p %.3f-%.3f nis rms %s jumps %d t %.2f %.2f bad %s ctrl err p %.1f sh %.1f SHmin %.1f N %.0f-%.0f'%(abs(x[:,14]).max()/RPM,abs(x[:,15]).max()/KPA,abs(np.exp(x[:,12])-d['blow'][i:]).max(),L['sd'][i:,2].min()/RPM,L['sd'][i:,2].max()/RPM,L['sd'][i:,3].min()/KPA,L['sd'][i:,3].max()/KPA,np.round(np.sqrt((L['nis'][i:]**2).mean(0)),2),L['ob'].jumps,*L['t'],getattr(L['ob'],'bad',0),abs(L['y'][i:,0]-L['ref'][i:,0]).max()/KPA,abs(L['y'][i:,1]-L['ref'][i:,1]).max(),L['y'][:,1].min(),L['u'][:,0].min()/RPM,L['u'][:,0].max()/RPM))
        on=int(900/H)
        fn=np.where(np.arange(n)>=on,40*RPM,0.0); L=run(d,f_n=fn); x=L['x'][:,14]/RPM; xp=L['x'][:,15]/KPA
        print('   40rpm: >6 after %.1f s, >20 after %.1f; rest %.1f-%.1f, f_p max %.2f'%(np.argmax(x[on:]>6)*H,np.argmax(x[on:]>20)*H,x[on+600:].min(),x[on+600:].max(),abs(xp[on:]).max()))
        fp=np.where(np.arange(n)>=on,5*KPA,0.0); L=run(d,f_p=fp); x=L['x'][:,14]/RPM; xp=L['x'][:,15]/KPA
        print('   5kPa: >0.4 after %.1f s; rest %.2f-%.2f, f_N max %.2f jumps %d'%(np.argmax(xp[on:]>0.4)*H,xp[on+600:].min(),xp[on+600:].max(),abs(x[on:]).max(),L['ob'].jumps))
