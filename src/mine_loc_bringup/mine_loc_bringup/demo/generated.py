"""A recording made on the spot: several people in a mine."""

from pathlib import Path

import numpy as np

from mine_loc_bringup.demo.playback import Playback, Truth
from mine_loc_core.people import load_people
from mine_loc_core.site import load_site
from mine_loc_core.stamps import NS_PER_S, to_ns
from mine_loc_sim.byte_streams import byte_blocks
from mine_loc_sim.scenario import Scenario
from mine_loc_sim.scene import SceneOptions, crew
from mine_loc_sim.serial_lines import Ahead

_TRUTH_RATE_HZ = 20
_MARGIN_NS = NS_PER_S  # stamps of the first and last outputs may lie a little outside


def load(folder: Path, people: int, seconds: float, seed: int) -> Playback:
    """Simulate `people` at a site; the bytes are made while they are played, the truth is there at once.

    Raises ConfigurationError for a site that cannot be simulated.
    """
    site = load_site(folder)
    taking_part = crew(site, tuple(load_people(folder)), people)
    scenario = Scenario(site, taking_part, SceneOptions(seed=seed, seconds=seconds))
    ahead = Ahead(byte_blocks(scenario), scenario.lines)
    lines = {line: ahead.arrivals(line) for line in scenario.lines}
    stamps = np.arange(-_MARGIN_NS, to_ns(seconds) + _MARGIN_NS, NS_PER_S // _TRUTH_RATE_HZ)
    truths = [
        Truth(
            person.name, stamps / NS_PER_S, scenario.pose(person.name, stamps).position_m, shared_clock_and_frame=True
        )
        for person in taking_part
    ]
    return Playback(f"simulated {site.name}, seed {seed}", str(folder.resolve()), lines, seconds, truths, taking_part)
