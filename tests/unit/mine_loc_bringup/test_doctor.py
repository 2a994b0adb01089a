"""What the doctor finds, and what it says to do."""

import json
import os
import socket
import time

import pytest

from mine_loc_bringup import doctor
from mine_loc_bringup.doctor import Finding, Grade
from mine_loc_bringup.main import main


def by_subject(findings) -> dict[str, Finding]:
    return {finding.subject: finding for finding in findings}


@pytest.mark.parametrize(
    ("version", "grade"),
    [((3, 10, 9), Grade.MISSING), ((3, 11, 0), Grade.GOOD), ((3, 12, 3), Grade.GOOD), ((3, 13, 0), Grade.DOUBTFUL)],
)
def test_python_3_11_is_the_oldest_that_will_do(version, grade):
    assert doctor.check_python(version).grade is grade


def test_a_missing_tool_is_named_with_its_package(monkeypatch):
    monkeypatch.setattr(doctor.shutil, "which", lambda tool: None if tool == "g++" else f"/usr/bin/{tool}")
    tools = by_subject(doctor.check_tools())
    assert (tools["g++"].grade, tools["g++"].remedy) == (Grade.MISSING, "sudo apt-get install g++")
    assert (tools["make"].grade, tools["make"].remedy) == (Grade.GOOD, "")


def test_a_python_without_ensurepip_lacks_the_venv_package(monkeypatch):
    monkeypatch.setattr(doctor.importlib.util, "find_spec", lambda _: None)
    venv = by_subject(doctor.check_tools())["venv"]
    assert (venv.grade, venv.remedy) == (Grade.MISSING, "sudo apt-get install python3-venv")


def test_a_missing_library_is_named_with_both_ways_to_get_it(monkeypatch):
    monkeypatch.setattr(doctor.importlib.util, "find_spec", lambda name: None if name == "serial" else object())
    libraries = by_subject(doctor.check_modules())
    assert libraries["pyserial"].grade is Grade.MISSING
    assert libraries["pyserial"].remedy == "make setup, or sudo apt-get install python3-serial"
    assert libraries["numpy"].grade is Grade.GOOD


def test_a_ros_that_does_not_load_is_told_with_its_own_last_words(monkeypatch):
    monkeypatch.setattr(doctor, "_ROS_PROBE", "raise ImportError('no librcl.so')")
    finding = doctor.check_ros()
    assert (finding.grade, finding.found) == (Grade.MISSING, "ImportError: no librcl.so")


def test_a_ros_that_hangs_is_not_waited_for(monkeypatch):
    monkeypatch.setattr(doctor, "_ROS_PROBE", "import time; time.sleep(600)")
    assert doctor.check_ros(timeout_s=0.1).grade is Grade.MISSING


def test_a_serial_port_without_permission_is_told(tmp_path, monkeypatch):
    (tmp_path / "ttyUSB0").touch()
    monkeypatch.setattr(doctor.os, "access", lambda *_: False)
    assert [(f.grade, f.remedy[:20]) for f in doctor.check_serial_ports(tmp_path)] == [
        (Grade.DOUBTFUL, "sudo adduser $USER d")
    ]


def test_a_usable_serial_port_and_none_at_all_are_both_good(tmp_path):
    assert [f.found for f in doctor.check_serial_ports(tmp_path)] == ["none plugged in"]
    (tmp_path / "ttyACM0").touch()
    assert [f.found for f in doctor.check_serial_ports(tmp_path)] == ["usable"]


def test_discovery_beyond_this_host_is_doubtful():
    assert doctor.check_discovery_range({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}).grade is Grade.GOOD
    assert doctor.check_discovery_range({}).grade is Grade.DOUBTFUL


def test_an_impossible_domain_is_refused():
    for domain in ("233", "-1", "x"):
        assert doctor.check_ports(domain).grade is Grade.MISSING


def test_a_taken_port_is_not_counted_as_free():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as holder:
        holder.bind(("", 0))
        port = holder.getsockname()[1]
        assert not doctor._is_free(port)
    assert doctor._is_free(port)


def test_too_little_shared_memory_is_told(monkeypatch, tmp_path):
    assert doctor.check_shared_memory(tmp_path / "nowhere").grade is Grade.DOUBTFUL
    monkeypatch.setattr(doctor, "SHARED_MEMORY_NEEDED", 1 << 60)
    assert "--shm-size" in doctor.check_shared_memory(tmp_path).remedy


def test_one_core_is_doubtful():
    assert [doctor.check_cores(n).grade for n in (1, 2)] == [Grade.DOUBTFUL, Grade.GOOD]


def test_a_slow_clock_source_and_a_date_in_the_past_are_doubtful(tmp_path):
    (tmp_path / "current_clocksource").write_text("hpet\n")
    assert (doctor.check_clock_source(tmp_path).grade, doctor.check_clock_source(tmp_path).found) == (
        Grade.DOUBTFUL,
        "hpet",
    )
    assert doctor.check_date(time.gmtime(0)).grade is Grade.DOUBTFUL


class TestCommand:
    FINE = Finding("a", Grade.GOOD, "here")
    ODD = Finding("b", Grade.DOUBTFUL, "odd", "look")
    GONE = Finding("c", Grade.MISSING, "not here", "get it")

    def run(self, monkeypatch, tmp_path, *findings: Finding) -> tuple[int, dict]:
        monkeypatch.setattr("mine_loc_bringup.commands.doctor.examine", lambda: list(findings))
        file = tmp_path / "new/doctor.json"
        return main(["doctor", "--json", os.fspath(file)]), json.loads(file.read_text())

    def test_what_is_only_doubtful_does_not_fail(self, monkeypatch, tmp_path):
        assert self.run(monkeypatch, tmp_path, self.FINE, self.ODD)[0] == 0

    def test_what_is_missing_fails_and_is_listed(self, monkeypatch, tmp_path, capsys):
        status, report = self.run(monkeypatch, tmp_path, self.FINE, self.GONE)
        assert status == 1
        assert report["missing"] == ["c"]
        assert report["findings"][1] == {"subject": "c", "grade": "missing", "found": "not here", "remedy": "get it"}
        assert "get it" in capsys.readouterr().out


def test_a_small_receive_buffer_is_named_with_the_command_that_widens_it(tmp_path):
    file = tmp_path / "rmem_max"
    file.write_text("212992\n")
    finding = doctor.check_receive_buffer(file)
    assert finding.grade is Grade.DOUBTFUL
    assert "net.core.rmem_max=4194304" in finding.remedy
    file.write_text("4194304\n")
    assert doctor.check_receive_buffer(file).grade is Grade.GOOD
