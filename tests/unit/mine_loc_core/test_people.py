"""The people file, and what happens when it changes under a running graph."""

import math
from pathlib import Path

import pytest

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.people import N100, PeopleFile, Stride, load_people

HEAD = "schema: 1\npeople:\n"
ANN = "  - {name: ann, tag_id: '0x022E', height_m: 1.7, n100: {port: /dev/n100, mounting_rpy_deg: [0, 90, 0]}}\n"
BOB = "  - {name: bob, height_m: 1.8}\n"


def written(folder: Path, text: str) -> Path:
    (folder / "people.yaml").write_text(text)
    return folder


def refusal(folder: Path, text: str) -> str:
    with pytest.raises(ConfigurationError) as caught:
        load_people(written(folder, text))
    return str(caught.value)


def test_people_are_found_by_name_and_by_tag(tmp_path):
    people = load_people(written(tmp_path, HEAD + ANN + BOB))
    ann, bob = people
    assert (people.by_name("ann"), people.by_name("bob"), people.by_name("eve")) == (ann, bob, None)
    assert (people.by_tag(0x22E), people.by_tag(9)) == (ann, None)


def test_nobody_wears_tag_zero(tmp_path):
    assert load_people(written(tmp_path, HEAD + BOB)).by_tag(0) is None


def test_an_n100_and_a_stride_take_their_defaults(tmp_path):
    ann, bob = load_people(written(tmp_path, HEAD + ANN + BOB))
    assert ann.n100 == N100("/dev/n100", 921_600, (0, math.pi / 2, 0))
    assert bob.n100 is None
    assert bob.stride == Stride(1, 0.371, 0.227, "pendulum")
    assert bob.tag_height_m is None


@pytest.mark.parametrize(
    ("stride", "model"),
    [
        ("{k: 0.9}", "pendulum"),
        ("{alpha: 0.3}", "paper_b"),
        ("{k: 1.1, beta: 0.2}", "paper_b"),
        ("{model: pendulum, alpha: 0.3}", "pendulum"),
        ("{model: paper_b}", "paper_b"),
    ],
)
def test_coefficients_of_paper_b_choose_its_model_where_none_is_named(tmp_path, stride, model):
    (person,) = load_people(written(tmp_path, HEAD + f"  - {{name: eve, height_m: 1.7, stride: {stride}}}\n"))
    assert person.stride.model == model


def test_an_unknown_step_length_model_is_refused(tmp_path):
    with pytest.raises(ConfigurationError, match="model"):
        load_people(written(tmp_path, HEAD + "  - {name: eve, height_m: 1.7, stride: {model: weinberg}}\n"))


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        ("{name: 9lives, height_m: 1.7}", "people[1].name: '9lives' is not allowed; allowed: text"),
        ("{name: pdr, height_m: 1.7}", "not uwb, pdr, sync"),
        ("{name: 'a b', height_m: 1.7}", "people[1].name"),
        ("{name: a__b, height_m: 1.7}", "people[1].name"),
        ('{name: "eve\\n", height_m: 1.7}', "people[1].name"),
        (
            "{name: ann, height_m: 1.7}",
            "people[1].name: 'ann' is given twice, first in line 3; allowed: each name once",
        ),
        ("{name: eve, tag_id: 558, height_m: 1.7}", "people[1].tag_id: 558 is given twice, first in line 3"),
        ("{name: eve, height_m: 1.7, n100: {port: /dev/n100}}", "people[1].n100.port: '/dev/n100' is given twice"),
        ("{name: eve, height_m: 170}", "people[1].height_m: 170 is not allowed; allowed: a number 1.0 to 2.3"),
        ("{name: eve, height_cm: 170}", "people[1].height_cm: no such key; use height_m, in metres"),
        ("{name: eve, height_m: 1.7, n100: {port: COM3}}", "people[1].n100.port: 'COM3' is not allowed"),
        (
            "{name: eve, height_m: 1.7, n100: {port: /d, mounting_rpy_rad: [0, 0, 0]}}",
            "use mounting_rpy_deg, in degrees",
        ),
        ("{name: eve, height_m: .nan}", "people[1].height_m: nan is not allowed"),
    ],
)
def test_each_mistake_is_one_line_that_names_key_value_and_what_is_allowed(tmp_path, entry, says):
    message = refusal(tmp_path, f"{HEAD}{ANN}  - {entry}\n")
    assert says in message
    assert message.startswith(f"{tmp_path}/people.yaml:4: ")


def test_several_people_may_go_without_a_tag(tmp_path):
    assert len(load_people(written(tmp_path, HEAD + BOB + BOB.replace("bob", "eve")))) == 2


class TestHotReload:
    def test_nothing_happens_while_the_file_says_the_same(self, tmp_path):
        file = PeopleFile(written(tmp_path, HEAD + ANN))
        assert file.poll() is None
        written(tmp_path, "# a comment\n" + HEAD + ANN)
        assert file.poll() is None

    def test_a_good_change_is_returned_once(self, tmp_path):
        file = PeopleFile(written(tmp_path, HEAD + ANN))
        written(tmp_path, HEAD + ANN + BOB)
        assert [person.name for person in file.poll() or ()] == ["ann", "bob"]
        assert file.poll() is None

    def test_a_bad_change_keeps_the_last_good_people_and_says_why(self, tmp_path):
        file = PeopleFile(written(tmp_path, HEAD + ANN))
        written(tmp_path, HEAD + BOB + BOB)
        assert file.poll() is None
        assert file.error is not None
        assert "people[1].name: 'bob' is given twice" in file.error
        assert [person.name for person in file.people] == ["ann"]

    def test_the_error_goes_when_the_file_is_mended_even_to_what_it_was(self, tmp_path):
        file = PeopleFile(written(tmp_path, HEAD + ANN))
        written(tmp_path, "garbage: [")
        file.poll()
        written(tmp_path, HEAD + ANN)
        assert file.poll() is None
        assert file.error is None

    def test_a_vanished_file_keeps_the_last_good_people(self, tmp_path):
        file = PeopleFile(written(tmp_path, HEAD + ANN))
        (tmp_path / "people.yaml").unlink()
        assert file.poll() is None
        assert "No such file" in (file.error or "")
        assert len(file.people) == 1
        written(tmp_path, HEAD + ANN)
        assert file.poll() is None
        assert file.error is None

    def test_a_bad_file_at_the_start_is_refused(self, tmp_path):
        with pytest.raises(ConfigurationError):
            PeopleFile(written(tmp_path, "people: 3"))
