"""Which anchors are worth activating: those near a region, as fine positioning is used only inside (paper E, 6)."""

import math
from collections.abc import Iterable, Sequence

from mine_loc_coarse.situation import Region
from mine_loc_core.site import Anchor


def anchors_to_wake(
    regions: Iterable[Region], anchors: Sequence[Anchor], reach_m: float, most: int = 4096
) -> list[tuple[int, int]]:
    """Anchor and region ids, each anchor once, for the region that it is nearest to; at most `most`, nearest first.

    An anchor is worth it within `reach_m` of the region's circle. Ambiguous and lost regions wake anchors too: they are
    where fine positioning can decide.
    """
    nearest: dict[int, tuple[float, int]] = {}
    for region in regions:
        for anchor in anchors:
            away_m = math.dist(region.centre_m, anchor.position_m[:2])
            if away_m <= region.radius_m + reach_m and away_m < nearest.get(anchor.id, (math.inf, 0))[0]:
                nearest[anchor.id] = away_m, region.id
    chosen = sorted(nearest.items(), key=lambda item: item[1])[:most]
    return [(anchor, region) for anchor, (_, region) in chosen]
