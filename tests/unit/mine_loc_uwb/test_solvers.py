"""What every solver of the table promises, whatever its method."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from uwb_scenes import LINE, ROOM, Tag, is_covariance, sd_m

from mine_loc_core.verdicts import Reason
from mine_loc_uwb.fix import FixStatus
from mine_loc_uwb.parameters import RANGE_METHODS, TDOA_METHODS, UwbSolverParameters
from mine_loc_uwb.solvers import RANGE_SOLVERS, TDOA_SOLVERS


def solver(method: str):
    return RANGE_SOLVERS[method](UwbSolverParameters(method=method))


def test_the_names_that_parameters_allow_are_those_of_the_tables():
    assert sorted(RANGE_METHODS) == sorted(RANGE_SOLVERS)
    assert sorted(TDOA_METHODS) == sorted(TDOA_SOLVERS)


def test_the_defaults_are_names_of_the_tables():
    assert UwbSolverParameters().method in RANGE_SOLVERS
    assert UwbSolverParameters().tdoa_method in TDOA_SOLVERS


def keeps_its_promises(solution, count: int) -> None:
    fix = solution.fix
    assert len(solution.reasons) == len(solution.mahalanobis_sq) == count
    if fix.status is FixStatus.OK:
        assert np.isfinite(fix.position_m).all()
        assert is_covariance(fix.covariance_m2)
        assert fix.ranges_used == solution.reasons.count(Reason.ACCEPTED)
    else:
        assert np.isnan(fix.position_m).all()
        assert Reason.ACCEPTED not in solution.reasons


@pytest.mark.parametrize("method", RANGE_METHODS)
@settings(max_examples=8)
@given(st.integers(0, 2**32 - 1), st.integers(0, 8), st.booleans())
def test_any_rounds_on_any_anchors_are_answered_range_by_range(method, seed, count, space):
    rng = np.random.default_rng(seed)
    anchors = rng.uniform([0, 0, 0], [40, 40, 6], (count, 3))
    tag = Tag(seed, anchors=anchors, start_m=(*rng.uniform(0, 40, 2), 1.2), velocity_m_s=(0.8, 0, 0), space=space)
    subject, at_s = solver(method), 0.0
    for _ in range(25):
        at_s += rng.choice([0.1, 0.5, 3.0, 31.0], p=[0.7, 0.2, 0.07, 0.03])
        heard = np.flatnonzero(rng.random(count) < 0.8).tolist()
        spoilt = {place: rng.uniform(-5.0, 20.0) for place in heard if rng.random() < 0.15}
        keeps_its_promises(subject.solve(tag.round(at_s, only=heard, excess=spoilt)), len(heard))


@pytest.mark.parametrize("method", RANGE_METHODS)
@pytest.mark.parametrize("space", [False, True])
def test_good_rounds_give_good_positions(method, space):
    tag, subject = Tag(1, velocity_m_s=(0.6, 0.3, 0.0), start_m=(4.0, 4.0, 1.2), space=space), solver(method)
    solutions = [(tag.round(at_s), at_s) for at_s in np.arange(0.0, 6.0, 0.2)]
    solutions = [(subject.solve(round_), at_s) for round_, at_s in solutions]
    assert {reason for solution, _ in solutions for reason in solution.reasons} == {Reason.ACCEPTED}
    errors = [tag.error_m(solution.fix, at_s) for solution, at_s in solutions[5:]]
    assert np.mean(errors) < (0.35 if space else 0.1)
    assert {solution.fix.dimensions for solution, _ in solutions} == {3 if space else 2}


@pytest.mark.parametrize("method", RANGE_METHODS)
def test_a_known_height_is_kept(method):
    fix = solver(method).solve(Tag(2, start_m=(6.0, 5.0, 1.37)).round(0.0)).fix
    assert fix.position_m[2] == 1.37
    assert not fix.covariance_m2[2].any()
    assert not fix.covariance_m2[:, 2].any()


@pytest.mark.parametrize("method", RANGE_METHODS)
def test_anchors_all_on_a_line_are_degenerate_or_spanned(method):
    tag = Tag(3, anchors=LINE, start_m=(22.0, 4.0, 1.0))
    solution = solver(method).solve(tag.round(0.0))
    if method in {"robust_tracker", "particle_filter"} and solution.fix.status is FixStatus.OK:
        assert abs(solution.fix.position_m[1]) < 1.0
        assert sd_m(solution.fix) > 2.5
    else:
        assert solution.fix.status is FixStatus.DEGENERATE
        assert set(solution.reasons) == {Reason.DEGENERATE}


@pytest.mark.parametrize("method", RANGE_METHODS)
def test_a_solver_does_not_change_what_it_is_given(method):
    tag, subject = Tag(4), solver(method)
    for at_s in (0.0, 0.1, 0.2):
        round_ = tag.round(at_s)
        fields = ("anchor_ids", "anchors_m", "range_m", "variance_m2", "since_s", "los_probability")
        before = [getattr(round_, name).copy() for name in fields]
        subject.solve(round_)
        for name, value in zip(fields, before, strict=True):
            assert np.array_equal(getattr(round_, name), value, equal_nan=True)


@pytest.mark.parametrize("method", RANGE_METHODS)
def test_the_same_rounds_give_the_same_fixes_to_the_bit(method):
    runs = []
    for _ in range(2):
        tag, subject = Tag(5), solver(method)
        runs.append([subject.solve(tag.round(at_s)).fix.position_m.tobytes() for at_s in np.arange(0.0, 2.0, 0.1)])
    assert runs[0] == runs[1]


@pytest.mark.parametrize("method", RANGE_METHODS)
def test_where_the_map_lies_does_not_matter(method):
    """Coordinates of a mine may be in the hundreds of thousands."""
    here, far = (
        Tag(6, anchors=ROOM + shift, start_m=np.array([6.0, 5.0, 1.0]) + shift)
        for shift in ([0.0] * 3, [4e5, 5e6, 0.0])
    )
    subjects = solver(method), solver(method)
    for at_s in (0.0, 0.1, 0.2):
        fixes = [subject.solve(tag.round(at_s)).fix for subject, tag in zip(subjects, (here, far), strict=True)]
    assert fixes[1].position_m - [4e5, 5e6, 0.0] == pytest.approx(fixes[0].position_m, abs=1e-4)
    assert fixes[1].covariance_m2 == pytest.approx(fixes[0].covariance_m2, rel=1e-3, abs=1e-6)
