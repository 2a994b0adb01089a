"""The demonstration's own site folder."""

import math
from pathlib import Path

from mine_loc_bringup.site_folder import write_site_folder
from mine_loc_core.people import N100, Person, Stride, load_people
from mine_loc_core.site import load_site

SOURCE = Path(__file__).parents[3] / "config" / "isas_walk"


def test_only_the_ports_differ_from_the_shipped_folder(tmp_path):
    before = (SOURCE / "site.yaml").read_text("utf-8")
    ports = {"rtls": str(tmp_path / "rtls"), "carrier/n100": str(tmp_path / "imu")}
    target = tmp_path / "site"
    target.mkdir()
    (target / "left_over").touch()
    write_site_folder(SOURCE, target, ports)
    written, shipped = load_site(target), load_site(SOURCE)
    assert [receiver.port for receiver in written.uwb_receivers] == [str(tmp_path / "rtls")]
    assert written.anchors == shipped.anchors
    (carrier,) = load_people(target)
    assert carrier.n100.port == str(tmp_path / "imu")
    assert not (target / "left_over").exists()
    assert (SOURCE / "site.yaml").read_text("utf-8") == before


def test_people_are_written_as_they_are(tmp_path):
    worn = N100("/dev/x", 115200, (0.0, math.pi / 2, 0.0))
    people = (
        Person("one", 2**40, 1.81, worn, Stride(1.1, 0.3, 0.2, "paper_b"), 1.2),
        Person("two", 0, 1.6, None, Stride(), None),
    )
    write_site_folder(SOURCE, tmp_path / "site", {"rtls": "/dev/y", "one/n100": "/dev/x"}, people)
    assert tuple(load_people(tmp_path / "site")) == people
