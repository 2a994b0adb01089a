"""The clock of a replay: what is due happens in order, silence is skipped, jumps are told."""

from hypothesis import given
from hypothesis import strategies as st

from mine_loc_bringup.virtual_time import GAP_NS, VirtualTime


def test_what_is_due_happens_at_its_time_and_before_the_message():
    time, seen = VirtualTime(1_000), []
    time.at(300, lambda: seen.append(("late", time.ros_ns)))
    time.at(100, lambda: seen.append(("early", time.ros_ns)))
    time.at(501, lambda: seen.append(("after", time.ros_ns)))
    assert time.advance(1_500) == 0
    assert seen == [("early", 1_100), ("late", 1_300)]
    assert (time.ros_ns, time.steady_ns) == (1_500, 500)


def test_what_is_due_together_happens_in_the_order_of_asking():
    time, seen = VirtualTime(0), []
    for name in "abc":
        time.at(10, lambda name=name: seen.append(name))
    time.advance(10)
    assert seen == ["a", "b", "c"]


def test_a_jump_backwards_is_told_and_lets_no_time_pass():
    time, seen = VirtualTime(5_000), []
    time.at(1, lambda: seen.append("due"))
    assert time.advance(2_000) == -3_000
    assert (time.ros_ns, time.steady_ns, seen) == (2_000, 0, [])


def test_a_long_silence_is_a_jump_and_a_shorter_one_is_not():
    time = VirtualTime(0)
    assert time.advance(GAP_NS) == 0
    assert time.advance(2 * GAP_NS + 1) == GAP_NS + 1
    assert (time.ros_ns, time.steady_ns) == (2 * GAP_NS + 1, GAP_NS)


@given(st.lists(st.integers(0, 10**12), min_size=1, max_size=30), st.lists(st.integers(1, 10**12), max_size=30))
def test_steady_time_never_goes_back_and_every_event_happens_once(stamps_ns, dues_ns):
    time, steady_ns, happened = VirtualTime(0), [], []
    for number, due_ns in enumerate(dues_ns):
        time.at(due_ns, lambda number=number: happened.append((time.steady_ns, number)))
    for stamp_ns in stamps_ns:
        time.advance(stamp_ns)
        assert time.ros_ns == stamp_ns
        steady_ns.append(time.steady_ns)
    assert steady_ns == sorted(steady_ns)
    assert [number for _, number in happened] == sorted(
        (number for number, due_ns in enumerate(dues_ns) if due_ns <= time.steady_ns), key=lambda n: (dues_ns[n], n)
    )
