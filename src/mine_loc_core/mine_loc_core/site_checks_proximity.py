"""What no schema can see in zones round machines and in the relays that hold these."""

from collections.abc import Iterator
from typing import Any

from mine_loc_core.yaml_source import YamlSource


def zone_contradictions(source: YamlSource) -> Iterator[str]:
    """Zones without a place, of unknown vehicles, or with a danger beyond the warning."""
    for index, zone in enumerate(source.content.get("zones", [])):
        here = ("zones", index)
        warning_m, danger_m = zone.get("warning_m"), zone.get("danger_m")
        if "vehicle" not in zone and "polygon_m" not in zone:
            yield source.problem((*here, "polygon_m"), "the key is missing; allowed: polygon_m, vehicle or both")
        if "vehicle" in zone:
            yield from _unknown_vehicle(source, (*here, "vehicle"), zone["vehicle"])
            if warning_m is None and danger_m is None:
                yield source.problem(
                    (*here, "vehicle"), "carries a zone of no use; allowed: with danger_m, warning_m or both"
                )
        if warning_m is not None and danger_m is not None and warning_m < danger_m:
            yield source.problem(
                (*here, "warning_m"), f"{warning_m} is less than danger_m; allowed: at least {danger_m}"
            )


def relay_contradictions(source: YamlSource) -> Iterator[str]:
    """Relays of vehicles that nothing ever stops or releases, and outputs that do not fit their port."""
    stopped = {z["vehicle"] for z in source.content.get("zones", []) if "vehicle" in z and "danger_m" in z}
    for index, relay in enumerate(source.content.get("relays", [])):
        here = ("relays", index)
        unknown = [*_unknown_vehicle(source, (*here, "vehicle"), relay["vehicle"])]
        yield from unknown
        if not unknown and relay["vehicle"] not in stopped:
            problem = f"{relay['vehicle']!r} carries no zone with danger_m, so nothing tells it to run or stop"
            yield source.problem((*here, "vehicle"), f"{problem}; allowed: a vehicle with such a zone")
        tcp = relay["output"] == "modbus_tcp"
        if tcp != relay["port"].startswith("socket://"):
            allowed = "socket://host:port" if tcp else "a device path"
            yield source.problem(
                (*here, "port"), f"{relay['port']!r} does not fit output {relay['output']}; allowed: {allowed}"
            )


def _unknown_vehicle(source: YamlSource, path: tuple[Any, ...], name: str) -> Iterator[str]:
    known = [vehicle["id"] for vehicle in source.content.get("vehicles", [])]
    if name not in known:
        yield source.problem(
            path, f"{name!r} is no vehicle of this site; allowed: {', '.join(known) or 'none, as vehicles is empty'}"
        )
