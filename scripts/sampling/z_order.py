"""Z-order scrambling of pixels that can be extended to any number of samples, beside the sampler of the renderer: on the host, on integrands of two and
four dimensions. docs/notebook/2026-11-22-z-order.md has what it prints. Needs numpy.

Of index t = (Morton index of the pixel, digits of the sample index reversed), 8 digits of base 4 each, the points are P(1) t and P(w) t over GF(4), w a
root of x^2 + x + 1, P(c) Pascal's matrix scaled by powers of c: the first 4^k samples of every aligned block of 4^a pixels are a (0, a + k, 2)-net in
base 4 together, for all a and k. Ahmed and Wonka (2020) fix the number of samples in advance instead."""
import numpy as np
U=np.uint32
def h(x):
    x=x.astype(U) if hasattr(x,'astype') else U(x)
    with np.errstate(over='ignore'):
        x=x^(x>>U(16)); x=x*U(0x7feb352d); x=x^(x>>U(15)); x=x*U(0x846ca68b); return x^(x>>U(16))
def hc(s,v):
    with np.errstate(over='ignore'): return h(np.asarray(s,U)^h(np.asarray(v,U)+U(0x9e3779b9)))
def rev(x):
    x=np.asarray(x,U)
    for s,m in ((1,0x55555555),(2,0x33333333),(4,0x0f0f0f0f),(8,0x00ff00ff)):
        x=((x>>U(s))&U(m))|((x&U(m))<<U(s))
    return (x>>U(16))|(x<<U(16))
def rev4(x): # digits
    x=np.asarray(x,U)
    for s,m in ((2,0x33333333),(4,0x0f0f0f0f),(8,0x00ff00ff)):
        x=((x>>U(s))&U(m))|((x&U(m))<<U(s))
    return (x>>U(16))|(x<<U(16))
def lk(x,s):
    with np.errstate(over='ignore'):
        s=np.asarray(s,U); x=x^(x*U(0x3d20adea)); x=x+s; x=x*((s>>U(16))|U(1)); x=x^(x*U(0x05526c56)); return x^(x*U(0x53a22864))
def owen(x,s): return rev(lk(rev(x),s))
def pascal4(t): # row j = sum_k binom(k,j) t_k on digits; digits at 2-bit stride
    v=np.asarray(t,U)
    v=v^((v&U(0xcccccccc))>>U(2)); v=v^((v&U(0xf0f0f0f0))>>U(4)); v=v^((v&U(0xff00ff00))>>U(8)); v=v^((v&U(0xffff0000))>>U(16)); return v
def w1(v): # omega*v: a1'=a1^a0, a0'=a1
    hi=v&U(0xaaaaaaaa); lo=v&U(0x55555555)
    return (hi^(lo<<U(1)))|(hi>>U(1))
def w2(v): return w1(w1(v))
M=[sum(3<<(2*k) for k in range(16) if k%3==r) for r in range(3)]
def mulpow(v,sign):
    a,b=(w1(v),w2(v)) if sign>0 else (w2(v),w1(v))
    return (v&U(M[0]))|(a&U(M[1]))|(b&U(M[2]))
def xy(t):
    x=pascal4(t); y=mulpow(pascal4(mulpow(t,1)),-1)
    return rev4(x),rev4(y)   # digit 0 most significant
def sobol(i):
    i=np.asarray(i,U); v=i
    for s,m in ((1,0xaaaaaaaa),(2,0xcccccccc),(4,0xf0f0f0f0),(8,0xff00ff00),(16,0xffff0000)):
        v=v^((v&U(m))>>U(s))
    return rev(i),rev(v)
def old(seed,px,py,n,d):
    s=hc(hc(hc(seed,px),py),d); a,b=sobol(owen(n,s)); return owen(a,hc(s,0)),owen(b,hc(s,1))
def part(v):
    v=np.asarray(v,U)&U(0xff); v=(v|(v<<U(4)))&U(0x0f0f); v=(v|(v<<U(2)))&U(0x3333); return (v|(v<<U(1)))&U(0x5555)
def morton(px,py): return part(px)|(part(py)<<U(1))
def new(seed,px,py,n,d):
    px=np.asarray(px,U);py=np.asarray(py,U);n=np.asarray(n,U)
    s=hc(hc(hc(hc(seed,px>>U(8)),py>>U(8)),d),n>>U(16))
    m=owen(morton(px,py)<<U(16),hc(s,2))&U(0xffff0000)
    k=owen(n<<U(16),hc(s,3))>>U(16)
    k=(w1(k)&U(M[0]))|(w2(k)&U(M[1]|M[2]))
    k=rev4(k<<U(16))
    a,b=xy(m|k)
    return owen(a,hc(s,0)),owen(b,hc(s,1))
def is_net(a,b,k,base4=True):
    n=len(a)
    for q in range(0,2*k+1,2 if base4 else 1):
        ca=(a.astype(np.uint64)>>np.uint64(32-q)); cb=b.astype(np.uint64)>>np.uint64(32-(2*k-q))
        if len(np.unique(ca*np.uint64(1<<(2*k-q))+cb))!=n: return False
    return True
if __name__=='__main__':
    bad=0
    for d in range(3):
        for a in range(0,4):
            for K in range(0,4):
                for (bx,by,bn) in ((0,0,0),(3,5,1),(200>>a,131>>a,2)):
                    X,Y,N=np.meshgrid(np.arange(2**a)+(bx<<a),np.arange(2**a)+(by<<a),np.arange(4**K)+(bn*4**K if bn else 0))
                    A,B=new(7,X.ravel(),Y.ravel(),N.ravel(),d)
                    if not is_net(A,B,a+K): bad+=1; print('bad',d,a,K,bx,by,bn)
    print('bad',bad)
    X,Y=np.meshgrid(np.arange(128),np.arange(128)); X=X.ravel();Y=Y.ravel()
    g=np.array([1,2,1.])/4; G=np.outer(g,g)
    def filt(e):
        p=np.pad(e,1,mode='wrap'); return sum(G[i,j]*p[i:i+128,j:j+128] for i in range(3) for j in range(3))
    F={'disk':lambda u,v:((u-.5)**2+(v-.5)**2<.16)*1., 'edge':lambda u,v:(u*.7+v>.83)*1.,'smooth':lambda u,v:np.exp(-4*(u*u+v*v)),'prod':lambda u,v:u*v*4, 'lin':lambda u,v:u*2}
    rng=np.random.default_rng(1); r=rng.random((2,2_000_000))
    def q(a): return a.astype(float)/2**32
    def run(fn,spp,seeds=3):
        out={}
        for seed in range(seeds):
            acc={k:0 for k in list(F)+['4d']}
            for n in range(spp):
                u,v=map(q,fn(seed,X,Y,n,2)); u2,v2=map(q,fn(seed,X,Y,n,9))
                for k,f in F.items(): acc[k]=acc[k]+f(u,v)
                acc['4d']=acc['4d']+((u-.5)**2+(v2-.4)**2+(u2*v-.3)**2<.2)
            for k in acc:
                e=(acc[k]/spp).reshape(128,128); t=ref[k]; e=e-t
                a=out.setdefault(k,[0,0]); a[0]+=np.mean(e**2); a[1]+=np.mean(filt(e)**2)
        return {k:[np.sqrt(x/seeds) for x in v] for k,v in out.items()}
    gN=1500; gu,gv=np.meshgrid((np.arange(gN)+.5)/gN,(np.arange(gN)+.5)/gN)
    ref={k:f(gu,gv).mean() for k,f in F.items()}
    r4=rng.random((4,20_000_000)); ref['4d']=(((r4[0]-.5)**2+(r4[3]-.4)**2+(r4[2]*r4[1]-.3)**2)<.2).mean()
    for spp in (1,2,4,8,16,64,256):
        o=run(old,spp); z=run(new,spp)
        print(spp,' '.join(f"{k}: plain {z[k][0]/o[k][0]:.2f} filt {z[k][1]/o[k][1]:.2f} |" for k in o))
