"""The zones and vehicles of a site file as proximity sees them."""

import numpy as np

from mine_loc_core.site import Site, Vehicle, Zone
from mine_loc_fusion.proximity import Pose2, ProximityZone
from mine_loc_fusion.zone_shape import outline


def proximity_zones(site: Site) -> tuple[ProximityZone, ...]:
    """Zones with a warning or danger distance; one that a vehicle carries without corners has those of its body."""
    vehicles = {vehicle.id: vehicle for vehicle in site.vehicles}
    return tuple(
        _zone(zone, vehicles.get(zone.vehicle or ""))
        for zone in site.zones
        if zone.warning_m is not None or zone.danger_m is not None
    )


def standing_vehicles(site: Site) -> dict[str, Pose2]:
    """Where the vehicles stand that never move."""
    return {vehicle.id: pose_at_start(vehicle) for vehicle in site.vehicles if vehicle.stands}


def guarded_vehicles(zones: tuple[ProximityZone, ...]) -> tuple[str, ...]:
    """Vehicles that somebody in danger stops: those that carry a danger zone."""
    return tuple(dict.fromkeys(zone.vehicle for zone in zones if zone.vehicle and zone.danger_m is not None))


def pose_at_start(vehicle: Vehicle) -> Pose2:
    """Where the site file puts a vehicle."""
    return Pose2(vehicle.position_m[0], vehicle.position_m[1], vehicle.yaw_rad)


def _zone(zone: Zone, vehicle: Vehicle | None) -> ProximityZone:
    body = np.array(zone.polygon_m, dtype=float)
    if vehicle is not None and not zone.polygon_m:
        body = outline(vehicle.size_m[0], vehicle.size_m[1])
    return ProximityZone(zone.id, body, zone.vehicle, zone.warning_m, zone.danger_m)
