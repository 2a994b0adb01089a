"""The live map: the place for whoever comes, people and vehicles as they move, and nobody once they are silent."""

from collections.abc import Iterator

import pytest
from graph.processes import Running, node_command, running
from graph.shuttle_site import FAR_M, Surroundings, write_shuttle_site
from visualization_msgs.msg import Marker, MarkerArray

from mine_loc_core.nodes.qos import LATCHED

pytestmark = pytest.mark.graph


@pytest.fixture
def node(domain, tmp_path) -> Iterator[Running]:
    site = write_shuttle_site(tmp_path / "site", stands=False)
    with running(node_command("mine_loc_fusion.nodes.markers", {"site": site}), domain, tmp_path / "log") as run:
        yield run
        assert "Traceback" not in run.output


def test_people_and_vehicles_are_drawn_where_they_are_until_they_are_silent(node, observer):
    assert node.alive
    around = Surroundings(observer)
    place = observer.listen(MarkerArray, "map/markers", LATCHED)
    moving = observer.listen(MarkerArray, "people/markers")
    around.wait_for(lambda: len(place), what="the place")
    around.car_at_m = 7.0

    def drawn(group: str) -> Marker | None:
        markers = moving.messages[-1].markers if moving.messages else []
        return next((marker for marker in markers if marker.ns == group), None)

    around.wait_for(lambda: drawn("people") and drawn("vehicles") and drawn("danger"))
    person, car = drawn("people"), drawn("vehicles")
    assert (person.header.frame_id, person.type, person.pose.position.x) == ("map", Marker.CYLINDER, FAR_M)
    assert (car.type, car.pose.position.x, car.scale.x) == (Marker.CUBE, 7.0, 6.0)
    assert person.lifetime.sec == 1
    around.silent = True
    around.wait_for(lambda: drawn("people") is None, 3.0)
