"""Free constants of scenes, device lines and faults, each with its source or the word "assumed"."""

from mine_loc_core.stamps import NS_PER_MS, NS_PER_S

# Blocks in which a scene is made: a trade of memory and of the delay before the first byte against speed.
SHORTEST_BLOCK_NS, LONGEST_BLOCK_NS = 5 * NS_PER_S, 20 * NS_PER_S
PERSON_NS_A_BLOCK = 200 * NS_PER_S
BLOCK_WITH_CIR_NS = NS_PER_S

# Ranging
ANCHORS_A_ROUND = 4
"""Most anchors that a tag ranges in a round, as the TREK1000 kit does."""
CANDIDATES = 8
"""Anchors near a tag whose ways are followed before the shortest few are ranged."""
DISCOVERY_ROUNDS = 10
"""A tag looks for anchors anew after so many rounds: assumed."""
REACH_M = 120.0
"""Longest way over which an anchor answers: assumed; vendors plan 20 to 50 m between anchors, 100 m in tunnels."""
LOST_ROUND_SHARE = 0.01
"""Rounds that collide or go unheard on their way to the receiver: assumed."""
CARRIER_OFFSET_SD_PPM = 0.1
"""Error of one reading of the carrier's clock offset: assumed, a resolution of about 1e-7."""

# N100
N100_PERIOD_US = 5000
"""0x40 and 0x41 alternate at this distance in a pair of frames captured from a device: 100 Hz of each."""
N100_CRYSTAL_SD_PPM = 15.0
"""Assumed: an ordinary crystal of ±40 ppm."""
N100_LONGEST_UP_S = 36_000
"""A device has been switched on for up to a shift: assumed."""
ABSENT_BAROMETER_PA = 101_325.0
"""What a device without barometer reports."""

# From measurement to arrival at the gateway: a fixed part and an exponential one, all assumed.
UWB_DELAY_NS, UWB_JITTER_NS = 4 * NS_PER_MS, NS_PER_MS
N100_DELAY_NS, N100_JITTER_NS = NS_PER_MS, NS_PER_MS // 3

# People and their ways
LATERAL_SHARE = 0.25
"""Way-points lie within this share of a gallery's width of its middle: assumed."""
PAUSE_SHARE, PAUSE_S = 0.2, (2.0, 8.0)
"""Legs on which somebody stops for a while: assumed."""
TURN_BACK_SHARE = 0.1
"""Legs on which somebody turns back half-way: assumed."""
OPEN_LEG_M = (4.0, 30.0)
OPEN_MARGIN_M = 3.0
"""Where there are no galleries, people walk legs of such lengths about the anchors, so far beyond them: assumed."""
CLEARANCE_M = 0.4
"""People keep so far from walls and obstacles: assumed."""

# Faults
NOISE_BYTES = (1, 40)
NOISE_SHARE = 0.2
"""Share of messages before which noise of so many bytes comes, while it lasts: assumed."""
TRUNCATED_SHARE = 0.2
"""Share of messages that lose their end, while it lasts: assumed."""
MOVED_M = (3.0, 0.0, 0.0)
"""Where a moved anchor hangs against the map: assumed, the next hook."""
CLOCK_STEP_US = 5_000_000
"""Step of a device's clock while it lasts: assumed; more than any stall, so that it shows as what it is."""
SATURATION_GAIN = 30.0
"""Blows: true rates and forces are so much larger, and are cut off at the sensor's range: assumed."""
