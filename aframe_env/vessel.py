from __future__ import annotations
from dataclasses import dataclass
from functools import cache
import numpy as np
@dataclass(frozen=True, eq=False)
class Vessel:
    name: str
    frequencies: np.ndarray
    headings: np.ndarray
    deck_response: np.ndarray
    @staticmethod
    @cache
    def supply():
        f=np.linspace(.1,2.5,40); h=np.linspace(0,2*np.pi,25)
        r=np.zeros((40,25,6),complex); r[:,:,2]=(1/(1+(f/1.0)**6))[:,None]; r[:,:,0]=1j*r[:,:,2]*np.cos(h);r[:,:,4]=.3*1j*r[:,:,2]*(f**2/9.81)[:,None]*np.cos(h)
        return Vessel('tmp',f,h,r)
