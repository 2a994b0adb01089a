"""What this computer has and lacks for mine_loc: each finding with what to do about it."""

import grp
import importlib.metadata
import importlib.util
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

_MODULES = {  # import name → (name on PyPI, package of Debian and Ubuntu)
    "numpy": ("numpy", "python3-numpy"),
    "scipy": ("scipy", "python3-scipy"),
    "yaml": ("PyYAML", "python3-yaml"),
    "jsonschema": ("jsonschema", "python3-jsonschema"),
    "serial": ("pyserial", "python3-serial"),
    "pymodbus": ("pymodbus", "python3-pymodbus"),
    "rich": ("rich", "python3-rich"),
    "matplotlib": ("matplotlib", "python3-matplotlib"),
    "mcap": ("mcap", ""),
    "rosbags": ("rosbags", ""),
}
_TOOLS = {"g++": "g++", "make": "make", "git": "git"}
_ROS_PROBE = """
import rclpy, mine_loc_interfaces.msg
rclpy.init()
rclpy.create_node("doctor").create_publisher(mine_loc_interfaces.msg.PersonPoseArray, "doctor", 1)
print(rclpy.get_rmw_implementation_identifier())
"""
_STEADY_CLOCKS = {"tsc", "kvm-clock", "arch_sys_counter", "hyperv_clocksource_tsc_page"}
RECEIVE_BUFFER_NEEDED = 4 << 20
SHARED_MEMORY_NEEDED = 64 << 20  # Fast DDS takes about 0.5 MiB a participant; a graph of 30 nodes with room to spare
_PARTICIPANTS = 40  # Fast DDS tries on from a taken port; half of these free will do
_LAST_DOMAIN = 232  # the last whose ports fit below 65536
_FIRST_YEAR = 2024


class Grade(Enum):
    """How a finding is to be taken."""

    GOOD = "good"
    DOUBTFUL = "doubtful"  # works, but look at it
    MISSING = "missing"  # mine_loc does not run without


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing looked at: what was found, and what mends it."""

    subject: str
    grade: Grade
    found: str
    remedy: str = ""


def examine() -> list[Finding]:
    """Look at everything."""
    return [
        check_python(sys.version_info[:3]),
        *check_tools(),
        *check_modules(),
        check_ros(),
        check_serial_group(),
        *check_serial_ports(),
        check_discovery_range(os.environ),
        check_ports(os.environ.get("ROS_DOMAIN_ID") or "0"),
        check_shared_memory(),
        check_receive_buffer(),
        check_cores(len(os.sched_getaffinity(0))),
        check_clock_source(),
        check_date(time.gmtime()),
    ]


def _judged(subject: str, good: bool, found: str, remedy: str, otherwise: Grade = Grade.DOUBTFUL) -> Finding:  # noqa: FBT001
    return Finding(subject, Grade.GOOD, found) if good else Finding(subject, otherwise, found, remedy)


def _apt(package: str) -> str:
    return f"sudo apt-get install {package}"


def check_python(version: tuple[int, ...]) -> Finding:
    """Python 3.11 or newer; 3.11 and 3.12 are tested."""
    text = ".".join(map(str, version))
    if version < (3, 11):
        return Finding("python", Grade.MISSING, text, "Python 3.11 or 3.12 (Debian 12, Ubuntu 24.04)")
    return _judged("python", version < (3, 13), text, "3.11 and 3.12 are the versions tested")


def check_tools() -> Iterator[Finding]:
    """The programs the build needs."""
    for tool, package in _TOOLS.items():
        path = shutil.which(tool)
        yield _judged(tool, path is not None, path or "not on PATH", _apt(package), Grade.MISSING)
    has_pip = importlib.util.find_spec("ensurepip") is not None
    found = "with pip" if has_pip else "cannot make environments: no module ensurepip"
    yield _judged("venv", has_pip, found, _apt("python3-venv"), Grade.MISSING)


def check_modules() -> Iterator[Finding]:
    """The Python libraries."""
    for module, (name, package) in _MODULES.items():
        if importlib.util.find_spec(module) is None:
            remedy = "make setup" + (f", or {_apt(package)}" if package else "")
            yield Finding(name, Grade.MISSING, "not installed", remedy)
        else:
            yield Finding(name, Grade.GOOD, _version(name))


def _version(distribution: str) -> str:
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return "version unknown"


def check_ros(timeout_s: float = 30.0) -> Finding:
    """Whether a node can publish our messages: tried out in a process of its own, which no other node discovers."""
    command = [sys.executable, "-c", _ROS_PROBE]
    environment = {**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}
    try:
        result = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=timeout_s, check=True)
    except subprocess.SubprocessError as error:
        output = (getattr(error, "stderr", None) or "").strip()
        remedy = "make setup, then . ./env.sh (full ROS: source its setup.bash, then the workspace's)"
        return Finding("ROS 2", Grade.MISSING, output.splitlines()[-1] if output else str(error), remedy)
    return Finding("ROS 2", Grade.GOOD, f"rclpy {_version('ros-jazzy-rclpy')}, {result.stdout.strip()}")


def check_serial_group() -> Finding:
    """Membership in the group that owns serial devices on Debian and Ubuntu."""
    try:
        dialout = grp.getgrnam("dialout").gr_gid
    except KeyError:
        return Finding("serial group", Grade.DOUBTFUL, "no group dialout", "find out who may use /dev/ttyUSB* here")
    member = os.geteuid() == 0 or dialout in {*os.getgroups(), os.getegid()}
    found = "may use serial ports" if member else "not in group dialout"
    return _judged("serial group", member, found, "sudo adduser $USER dialout, then log in again")


def check_serial_ports(folder: Path = Path("/dev")) -> Iterator[Finding]:
    """The USB serial devices that are plugged in."""
    ports = sorted([*folder.glob("ttyUSB*"), *folder.glob("ttyACM*")])
    if not ports:
        yield Finding("serial ports", Grade.GOOD, "none plugged in")
    for port in ports:
        usable = os.access(port, os.R_OK | os.W_OK)
        found = "usable" if usable else "no permission to read and write"
        yield _judged(str(port), usable, found, "sudo adduser $USER dialout, then log in again")


def check_discovery_range(environment: Mapping[str, str]) -> Finding:
    """How far ROS 2 programs of this shell look; `mine-loc up` takes it from the site file instead."""
    value = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET (default of ROS 2)")
    remedy = "export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST, unless other hosts shall be found"
    return _judged("discovery range", value == "LOCALHOST", value, remedy)


def check_ports(domain: str) -> Finding:
    """Free UDP ports for participants: 7400 + 250 domain + 10 + 2 participant (RTPS 2.2, section 9.6.1.1)."""
    if not domain.isdecimal() or int(domain) > _LAST_DOMAIN:
        return Finding("UDP ports", Grade.MISSING, f"ROS_DOMAIN_ID={domain}", f"a number from 0 to {_LAST_DOMAIN}")
    first = 7400 + 250 * int(domain) + 10
    free = sum(_is_free(first + 2 * participant) for participant in range(_PARTICIPANTS))
    found = f"{free} of the first {_PARTICIPANTS} of domain {domain} are free"
    remedy = "choose another ROS_DOMAIN_ID, or stop what holds them (ss -ulnp)"
    return _judged("UDP ports", free >= _PARTICIPANTS // 2, found, remedy)


def _is_free(port: int) -> bool:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(("", port))
        except OSError:
            return False
    return True


def check_shared_memory(folder: Path = Path("/dev/shm")) -> Finding:  # noqa: S108 it is only looked at
    """Room for the shared-memory transport."""
    if not folder.is_dir():
        return Finding("shared memory", Grade.DOUBTFUL, f"no {folder}", "mount a tmpfs there, else all goes over UDP")
    free = shutil.disk_usage(folder).free
    remedy = f"at least {SHARED_MEMORY_NEEDED >> 20} MiB (containers: --shm-size=256m)"
    return _judged("shared memory", free >= SHARED_MEMORY_NEEDED, f"{free >> 20} MiB free in {folder}", remedy)


def check_receive_buffer(file: Path = Path("/proc/sys/net/core/rmem_max")) -> Finding:
    """Room for the datagrams of discovery, which a restarted node gets all at once (`fast_discovery.xml`)."""
    room = int(file.read_text()) if file.is_file() else 0
    remedy = f"sysctl -w net.core.rmem_max={RECEIVE_BUFFER_NEEDED}, else a restarted node is found seconds later"
    return _judged("receive buffer", room >= RECEIVE_BUFFER_NEEDED, f"at most {room >> 10} KiB", remedy)


def check_cores(cores: int) -> Finding:
    """Processor cores this process may use."""
    return _judged("cores", cores >= 2, str(cores), "two or more for a live graph")


def check_clock_source(folder: Path = Path("/sys/devices/system/clocksource/clocksource0")) -> Finding:
    """What the kernel's clock counts with: reading some sources is slow and coarse."""
    file = folder / "current_clocksource"
    source = file.read_text().strip() if file.is_file() else "unknown"
    return _judged("clock source", source in _STEADY_CLOCKS, source, "see the kernel parameters clocksource= and tsc=")


def check_date(now: time.struct_time) -> Finding:
    """A computer without battery clock and network wakes up in the past; stamps would then jump."""
    found = time.strftime("%Y-%m-%d %H:%M UTC", now)
    return _judged("date", now.tm_year >= _FIRST_YEAR, found, "set the clock, or run an NTP client (package chrony)")
