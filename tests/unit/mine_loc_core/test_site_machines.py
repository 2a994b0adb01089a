"""Zones round machines and the relays that hold these, in the site file."""

import copy
from pathlib import Path

import pytest
import yaml

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.site import Relay, Site, Vehicle, Zone, ZoneType, load_site

CAR = {"id": "car", "size_m": [6.0, 2.0, 1.5]}
ROUND_CAR = {"id": "round_car", "type": "hazard_near", "vehicle": "car", "danger_m": 2.0, "warning_m": 5}
BRAKE = {"name": "brake", "vehicle": "car", "output": "modbus_tcp", "port": "socket://127.0.0.1:502"}
SQUARE = [[0, 0], [1, 0], [1, 1]]
GOOD = {"schema": 1, "name": "hall", "dimensions": 2, "tag_height_m": 1.0, "vehicles": [CAR], "zones": [ROUND_CAR]}


def loaded(folder: Path, **sections) -> Site:
    (folder / "site.yaml").write_text(yaml.safe_dump(copy.deepcopy(GOOD | sections), sort_keys=False))
    return load_site(folder)


def test_what_is_written_is_read_and_what_is_not_has_the_cautious_default(tmp_path):
    site = loaded(tmp_path, relays=[BRAKE])
    assert site.vehicles == (Vehicle("car", (6, 2, 1.5), (0, 0, 0), 0.0, (), stands=False),)
    assert site.zones == (Zone("round_car", "round_car", ZoneType.HAZARD_NEAR, (), "car", 5.0, 2.0),)
    assert site.relays == (Relay("brake", "car", "modbus_tcp", "socket://127.0.0.1:502", 9600, 1, (0,)),)


def test_a_zone_without_distances_is_none_of_proximity(tmp_path):
    (zone,) = loaded(tmp_path, zones=[{"id": "z", "type": "key", "polygon_m": SQUARE}]).zones
    assert (zone.vehicle, zone.warning_m, zone.danger_m) == (None, None, None)


@pytest.mark.parametrize(
    ("sections", "says"),
    [
        (
            {"zones": [{"id": "z", "type": "key"}]},
            "zones[0].polygon_m: the key is missing; allowed: polygon_m, vehicle",
        ),
        (
            {"zones": [ROUND_CAR | {"vehicle": "cart"}]},
            "zones[0].vehicle: 'cart' is no vehicle of this site; allowed: car",
        ),
        ({"zones": [ROUND_CAR], "vehicles": []}, "allowed: none, as vehicles is empty"),
        ({"zones": [{"id": "z", "type": "key", "vehicle": "car"}]}, "zones[0].vehicle: carries a zone of no use"),
        (
            {"zones": [ROUND_CAR | {"warning_m": 1}]},
            "zones[0].warning_m: 1 is less than danger_m; allowed: at least 2.0",
        ),
        ({"zones": [ROUND_CAR | {"danger_m": -1}]}, "zones[0].danger_m: -1 is not allowed"),
        ({"relays": [BRAKE, dict(BRAKE)]}, "relays[1].name: 'brake' is given twice"),
        ({"relays": [BRAKE | {"vehicle": "cart"}]}, "relays[0].vehicle: 'cart' is no vehicle"),
        (
            {"relays": [BRAKE], "zones": [{"id": "z", "type": "key", "vehicle": "car", "warning_m": 3}]},
            "relays[0].vehicle: 'car' carries no zone with danger_m",
        ),
        ({"relays": [BRAKE | {"output": "dtr"}]}, "relays[0].port: 'socket://127.0.0.1:502' does not fit output dtr"),
        ({"relays": [BRAKE | {"port": "/dev/ttyUSB0"}]}, "does not fit output modbus_tcp; allowed: socket://host:port"),
        ({"relays": [BRAKE | {"output": "relay"}]}, "one of modbus_tcp, modbus_rtu, dtr, rts"),
        ({"relays": [BRAKE | {"unit": 0}]}, "relays[0].unit: 0 is not allowed"),
        ({"relays": [BRAKE | {"coils": []}]}, "relays[0].coils"),
    ],
)
def test_each_mistake_is_one_line_that_names_key_value_and_what_is_allowed(tmp_path, sections, says):
    with pytest.raises(ConfigurationError) as caught:
        loaded(tmp_path, **sections)
    assert says in str(caught.value)
    assert str(caught.value).startswith(f"{tmp_path}/site.yaml:")
