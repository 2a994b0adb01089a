import math
from pathlib import Path

from mine_loc_bringup.site_folder import write_site_folder
from mine_loc_core.people import N100, Person, Stride, load_people
from mine_loc_core.site import load_site

SOURCE = Path(__file__).parents[3] / "config" / "example_mine"
PORTS = {"portal": "/tmp/a", "junction": "socket://127.0.0.1:9", "fitter/n100": "/tmp/b", "driver/n100": "/tmp/c"}


def test_only_the_ports_change(tmp_path: Path):
    write_site_folder(SOURCE, tmp_path / "site", PORTS)
    before, after = load_site(SOURCE), load_site(tmp_path / "site")
    assert [receiver.port for receiver in after.uwb_receivers] == ["/tmp/a", "socket://127.0.0.1:9"]
    assert after.anchors == before.anchors
    assert after.galleries == before.galleries
    people = {person.name: person for person in load_people(tmp_path / "site")}
    assert people["fitter"].n100 is not None
    assert people["fitter"].n100.port == "/tmp/b"
    assert people["visitor"].n100 is None


def test_people_are_written_as_they_are(tmp_path: Path):
    worn = N100("/dev/x", 115200, (0.0, math.pi / 2, 0.0))
    people = (
        Person("one", 2**40, 1.81, worn, Stride(1.1, 0.3, 0.2), 1.2),
        Person("two", 0, 1.6, None, Stride(), None),
    )
    write_site_folder(SOURCE, tmp_path / "site", {**PORTS, "one/n100": "/dev/x"}, people)
    assert tuple(load_people(tmp_path / "site")) == people
