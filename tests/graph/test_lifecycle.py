"""Lifecycle states through the standard services, over and over."""

from collections.abc import Iterator

import pytest
from graph.observer import Observer
from graph.processes import Running, node_command, running
from graph.walker import ranging, write_site
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from mine_loc_interfaces.msg import UwbPose, UwbRange, UwbRangeArray

pytestmark = pytest.mark.graph

CYCLES = 100


@pytest.fixture
def solver(tmp_path, domain) -> Iterator[Running]:
    parameters = {"site": write_site(tmp_path / "site", [], []), "autostart": False}
    with running(node_command("mine_loc_uwb.nodes.uwb_solver", parameters), domain, tmp_path / "solver.log") as run:
        yield run


def change(observer: Observer, transition: int) -> None:
    request = ChangeState.Request(transition=Transition(id=transition))
    assert observer.call(ChangeState, "/uwb_solver/change_state", request).success


def state(observer: Observer) -> int:
    return observer.call(GetState, "/uwb_solver/get_state", GetState.Request()).current_state.id


def round_message(number: int) -> UwbRangeArray:
    message = UwbRangeArray(tag_id=5, seq=number)
    message.header.stamp.sec = 100 + number
    message.ranges = [
        UwbRange(anchor_id=item.anchor_id, range=item.range_m, range_variance=0.01) for item in ranging(0.0, 0).ranges
    ]
    return message


def test_a_node_survives_a_hundred_cycles_and_answers_each_round_once_while_active(solver, observer):
    poses = observer.listen(UwbPose, "uwb/pose")
    rounds = observer.node.create_publisher(UwbRangeArray, "uwb/ranges", 10)
    sent = []

    def send() -> None:
        sent.append(len(sent) + 1)
        rounds.publish(round_message(sent[-1]))

    for _ in range(CYCLES):
        change(observer, Transition.TRANSITION_CONFIGURE)
        observer.wait_for(lambda: rounds.get_subscription_count() == 1, what="the one subscription")
        send()  # inactive: not heard
        assert state(observer) == State.PRIMARY_STATE_INACTIVE
        change(observer, Transition.TRANSITION_ACTIVATE)
        observer.wait_for(lambda: observer.node.count_publishers("uwb/pose") == 1, what="the one publisher")
        send()
        wanted = sent[-1]
        observer.wait_for(
            lambda n=wanted: n in [pose.seq for pose in poses.messages], what=f"the pose of round {wanted}"
        )
        change(observer, Transition.TRANSITION_DEACTIVATE)
        change(observer, Transition.TRANSITION_CLEANUP)
        observer.wait_for(lambda: rounds.get_subscription_count() == 0, what="no subscription left")
        assert state(observer) == State.PRIMARY_STATE_UNCONFIGURED
    assert [pose.seq for pose in poses.messages] == sent[1::2]
    assert solver.alive
    assert "Traceback" not in solver.output


def test_an_inactive_node_says_so(solver, observer):
    assert solver.alive
    change(observer, Transition.TRANSITION_CONFIGURE)
    observer.wait_for(lambda: observer.status.get("uwb_solver: callbacks") is not None)
    assert observer.status["uwb_solver: callbacks"].message == "inactive"


def test_a_configuration_that_is_impossible_refuses_the_transition_and_may_be_mended(solver, observer, tmp_path):
    assert solver.alive
    site = tmp_path / "site" / "site.yaml"
    good = site.read_text()
    site.write_text(good.replace("schema: 1", "schema: 7"))
    request = ChangeState.Request(transition=Transition(id=Transition.TRANSITION_CONFIGURE))
    assert not observer.call(ChangeState, "/uwb_solver/change_state", request).success
    assert state(observer) == State.PRIMARY_STATE_UNCONFIGURED
    site.write_text(good)
    change(observer, Transition.TRANSITION_CONFIGURE)
    change(observer, Transition.TRANSITION_ACTIVATE)
    assert state(observer) == State.PRIMARY_STATE_ACTIVE
