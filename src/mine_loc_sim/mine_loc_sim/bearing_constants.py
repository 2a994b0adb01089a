"""Free constants of emitters and direction-finding monitors, each with its source or the word "assumed".

Paper E gives 256 frequencies, an accuracy of 1000 Hz and a detection range of 5 km, and no errors of bearings; the
round, the delay, the loss and the 2° are those of the project's own measure of coarse regions.
"""

import math

from mine_loc_core.stamps import NS_PER_S

# Emitters
CHANNELS = 256
"""Paper E."""
FIRST_CHANNEL_HZ = 433_000_000.0
"""Lower edge of channel 0: assumed, hand-held UHF radios."""
CHANNEL_SPACING_HZ = 25_000.0
"""Assumed, as in land mobile radio."""
OCCUPIED_HZ = 16_000.0
"""Width of an emission, in the middle of its channel: assumed; 16K0F3E is what a 25 kHz channel carries."""
TRANSMIT_POWER_DBM = 30.0
"""Assumed: a hand-held radio of 1 W."""
SPEED_M_S = 1.0
"""Of a random walk, paper E's setting as the project reads it."""
LEG_NS = 60 * NS_PER_S
"""A random walk changes its course after so long: assumed."""

# Monitors
DETECTION_RANGE_M = 5000.0
"""Paper E, R."""
ROUND_NS = 5 * NS_PER_S
DWELL_NS = ROUND_NS // CHANNELS
"""Assumed: all monitors scan the channels in step, one after the other, and a scan takes a whole round."""
NOISE_SD_RAD = math.radians(2.0)
LONGEST_DELAY_NS = 5 * NS_PER_S
LOST_SHARE = 0.1
FREQUENCY_ACCURACY_HZ = 1000.0
"""Paper E, taken as the largest error of a measured frequency."""
LEAST_CONFIDENCE = 0.5
SURE_MARGIN_DB = 20.0
"""Confidence grows with the level, from the least at the detection range to 1 so far above it: assumed."""
