"""The demonstration's own site folder."""

from pathlib import Path

from mine_loc_bringup.site_folder import write_site_folder
from mine_loc_core.people import load_people
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
