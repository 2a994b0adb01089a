"""FDILink, attitude, steps, stride: pedestrian dead reckoning from a waist-worn N100."""
