"""The constant bearing error of each monitor."""
import numpy as np
from dataclasses import replace
class MonitorBias:
    def __init__(self, m, sd): self.mean_rad=np.zeros(m)
    def corrected(self, reports): return replace(reports, azimuth_rad=reports.azimuth_rad-self.mean_rad[reports.monitor])
