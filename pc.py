import numpy as np, json
F='/work/shared/data/ipol_gait_lowerback/GaitData/'
for n in ['1-6','3-3','3-4','3-5','3-6','5-6','7-1','7-2','7-3','11-1','1-1','3-1','7-4']:
    a=np.loadtxt(F+n+'_lb.txt.gz',skiprows=2); d=json.load(open(F+n+'.json'))
    c=a[:,0]; dc=np.diff(c); i=np.flatnonzero(dc!=1)
    nan=np.isnan(a).any(1).sum()
    rep=np.flatnonzero((np.diff(a[:,1:7],axis=0)==0).all(1))
    jump=np.abs(np.diff(a[:,1:4],axis=0)).max(1)
    print(n,len(a),c[0],c[-1],'gaps',[(int(k),float(dc[k])) for k in i[:10]],'nan',nan,'repeats',len(rep),rep[:5],'U',d['UTurnBoundaries'],'T',d['TrialBoundaries'],'maxjump',jump.max().round(1),jump.argmax())
