"""The `mine-loc` command line."""

import os
import select
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mine_loc_bringup.main import main

CONFIG = Path(__file__).parents[3] / "config"
DEADLINE_S = 20.0


@pytest.fixture
def site(tmp_path: Path) -> Path:
    return shutil.copytree(CONFIG / "example_mine", tmp_path / "site")


def break_line(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))


def test_without_a_command_the_help_is_shown_and_the_status_is_not_zero(capsys):
    with pytest.raises(SystemExit) as caught:
        main([])
    assert caught.value.code == 2
    assert "COMMAND" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["check", "doctor", "up"])
def test_each_command_s_help_teaches_by_example(command, capsys):
    with pytest.raises(SystemExit) as caught:
        main([command, "--help"])
    assert caught.value.code == 0
    assert f"Examples:\n  mine-loc {command}" in capsys.readouterr().out


def test_check_is_content_with_the_shipped_sites(capsys):
    folders = [str(file.parent) for file in CONFIG.glob("*/site.yaml")]
    assert main(["check", *folders]) == 0
    assert capsys.readouterr().out.count(": good: ") == len(folders)


def test_check_tells_the_mistakes_of_both_files_at_once(site, capsys):
    break_line(site / "site.yaml", "dimensions: 2 ", "dimensions: 5 ")
    break_line(site / "people.yaml", "height_m: 1.82", "height_m: 182")
    assert main(["check", str(site)]) == 2
    first, second = capsys.readouterr().err.splitlines()
    assert first.startswith(f"{site}/site.yaml:6: dimensions: 5 is not allowed; allowed: one of 2, 3")
    assert second.startswith(
        f"{site}/people.yaml:6: people[0].height_m: 182 is not allowed; allowed: a number 1.0 to 2.3"
    )


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            'anchor: "0x0101"',
            'anchor: "0x0999"',
            "uwb_receivers[0].anchor: '0x0999' is no anchor of this site; allowed: 0x0101",
        ),
        ('id: "0x0102"', 'id: "0x0101"', "anchors[1].id: '0x0101' is given twice, first in line 10"),
        (
            "[25.0, -1.8, 2.4]",
            "[.nan, -1.8, 2.4]",
            "anchors[1].position_m[0]: nan is not allowed; allowed: a finite number",
        ),
        ("position_m: [25.0", "position_mm: [25.0", "anchors[1].position_mm: no such key; use position_m, in metres"),
        (
            "port: /dev/serial",
            "port: COM7/serial",
            "uwb_receivers[0].port: 'COM7/serial/by-id/*portal*' is not allowed",
        ),
    ],
)
def test_up_refuses_a_bad_site_before_it_starts_anything(site, capsys, old, new, says):
    break_line(site / "site.yaml", old, new)
    assert main(["up", "--site", str(site)]) == 2
    output = capsys.readouterr()
    assert says in output.err
    assert "Traceback" not in output.err
    assert output.out == ""


def test_up_refuses_a_folder_without_a_site(tmp_path, capsys):
    assert main(["up", "--site", str(tmp_path)]) == 2
    assert "site.yaml: cannot be read: No such file or directory" in capsys.readouterr().err


class Up:
    """`mine-loc up` in a process of its own, whose nodes are stand-ins: modules that say what they are, then sleep."""

    def __init__(self, folder: Path, packages: Path) -> None:
        for module in ("mine_loc_pdr/nodes/n100_driver", "mine_loc_uwb/nodes/uwb_solver"):
            file = packages / f"{module}.py"
            file.parent.mkdir(parents=True)
            for package in (file.parent, file.parents[1]):
                (package / "__init__.py").touch()
            file.write_text(
                "import os, signal, time\nsignal.signal(signal.SIGTERM, signal.SIG_DFL)\n"
                "print('at', os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'])\ntime.sleep(600)"
            )
        command = [sys.executable, "-m", "mine_loc_bringup.main", "up", "--site", str(folder)]
        paths = [str(packages), *filter(None, sys.path)]
        self.process = subprocess.Popen(
            [*command, "--only", "n100_driver", "uwb_solver"],
            stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
        )
        assert self.process.stdout is not None
        self.output = self.process.stdout
        self.heard = ""

    def until(self, *texts: str) -> None:
        deadline_s = time.monotonic() + DEADLINE_S
        while not all(text in self.heard for text in texts):
            left_s = max(0.0, deadline_s - time.monotonic())
            assert select.select([self.output], [], [], left_s)[0], f"waited in vain; heard:\n{self.heard}"
            data = os.read(self.output.fileno(), 65536)
            assert data, f"the output ended; heard:\n{self.heard}"
            self.heard += data.decode()


@pytest.fixture
def up(site: Path, tmp_path: Path):
    """The graph of the example mine, for three nodes in two processes of it."""
    running = Up(site, tmp_path / "packages")
    with running.process:
        yield running
        running.process.kill()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_up_runs_its_processes_and_stops_them_when_asked(up, number):
    up.until("[uwb_solver] at LOCALHOST", "[n100_driver] at LOCALHOST")
    up.process.send_signal(number)
    up.until("[uwb_solver] stopped", "[n100_driver] stopped")
    assert up.process.wait(DEADLINE_S) == 0


def test_up_follows_people_who_come_and_go_and_reports_a_bad_edit(up, site):
    up.until("[uwb_solver] at", "[n100_driver] at")
    good = (site / "people.yaml").read_text()
    (site / "people.yaml").write_text(good.replace("height_m: 1.75", "height_m: 175"))
    up.until("people[1].height_m: 175 is not allowed", "The people stay as they were.")
    assert "stopped" not in up.heard
    (site / "people.yaml").write_text(good.replace("    n100:", "    # n100:"))
    up.until("[n100_driver] stopped")
    assert "[uwb_solver] stopped" not in up.heard
    up.heard = ""
    (site / "people.yaml").write_text(good.replace("name: driver", "name: blaster"))
    up.until("[n100_driver] at LOCALHOST")
    assert "[uwb_solver] stopped" not in up.heard
