"""Whose frame positions are solved in: the map's, or that of a vehicle which carries the anchors (paper C)."""

from dataclasses import dataclass

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.site import Anchor, Site


@dataclass(frozen=True, slots=True)
class AnchorFrame:
    """The name of a frame and the anchors placed in it."""

    name: str
    anchors: tuple[Anchor, ...]


def anchor_frame(site: Site, wanted: str) -> AnchorFrame:
    """The frame `wanted`: a vehicle's id, the map's name, or empty for the map, or the only vehicle where it has none.

    A vehicle's frame is `<id>/base_link` (REP 105). Raises ConfigurationError for a name the site does not have.
    """
    vehicles = {vehicle.id: frozenset(vehicle.anchor_ids) for vehicle in site.vehicles if vehicle.anchor_ids}
    fixed = site.fixed_anchors
    if not wanted and not fixed and len(vehicles) == 1:
        wanted = next(iter(vehicles))
    if wanted in vehicles:
        anchors = tuple(anchor for anchor in site.anchors if anchor.id in vehicles[wanted])
        return AnchorFrame(f"{wanted}/base_link", anchors)
    if wanted not in {"", site.map_frame}:
        allowed = ", ".join([site.map_frame, *vehicles])
        raise ConfigurationError(f"uwb_solver: frame: {wanted!r} is not known here; allowed: {allowed}")
    return AnchorFrame(site.map_frame, fixed)
