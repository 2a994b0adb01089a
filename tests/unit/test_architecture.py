"""The rules of the architecture: ROS at the edges, data flowing one way, files of a size to be read."""

import ast
import functools
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCES = sorted(path for path in (ROOT / "src").glob("mine_loc_*/**/*.py") if path.name != "setup.py")
PACKAGES = sorted(path.parent.name for path in (ROOT / "src").glob("*/setup.py"))
ROS = re.compile(r"rclpy|\w+_(msgs|interfaces|srvs)|rosidl\w*|launch(_\w+)?|ament_\w+|tf2_\w+")
ALLOWED = {
    "mine_loc_core": set(),
    "mine_loc_uwb": {"mine_loc_core"},
    "mine_loc_pdr": {"mine_loc_core"},
    "mine_loc_fusion": {"mine_loc_core", "mine_loc_uwb"},
    "mine_loc_coarse": {"mine_loc_core"},
    "mine_loc_sim": {"mine_loc_core", "mine_loc_uwb", "mine_loc_pdr", "mine_loc_fusion", "mine_loc_coarse"},
}
ALLOWED["mine_loc_bringup"] = ALLOWED["mine_loc_sim"] | {"mine_loc_sim"}
KEYLESS = {"rosbags", "mcap", "torch", "safetensors", "sqlalchemy", "alembic"}
# without a rosdep key: the graph runs without them, see below
ROSDEP = {  # import name → rosdep key
    "numpy": "python3-numpy",
    "scipy": "python3-scipy",
    "yaml": "python3-yaml",
    "jsonschema": "python3-jsonschema",
    "serial": "python3-serial",
    "pymodbus": "python3-pymodbus",
    "psutil": "python3-psutil",
    "rich": "python3-rich",
    "matplotlib": "python3-matplotlib",
    "numba": "python3-numba",
    "sklearn": "python3-sklearn",
    "threadpoolctl": "python3-threadpoolctl",
}
MOST_LINES = 400


def package_of(path):
    return path.relative_to(ROOT / "src").parts[0]


def is_wiring(path):
    return bool({"nodes", "launch"} & set(path.relative_to(ROOT / "src" / package_of(path)).parts[:-1]))


@functools.cache
def imports(path):
    """Full names of all modules a file imports, at any depth."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            names |= {str(node.module)} | {f"{node.module}.{alias.name}" for alias in node.names}
    return frozenset(names)


def roots(path):
    return {name.split(".")[0] for name in imports(path)}


@functools.cache
def tracked():
    names = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True, text=True).stdout
    return tuple(ROOT / name for name in names.split("\0") if name and (ROOT / name).is_file())


@functools.cache
def texts():
    """Tracked text files, without recorded bytes."""
    found = {}
    for path in tracked():
        data = path.read_bytes()
        if b"\0" not in data and path.suffix not in {".bin", ".png"}:
            found[path.relative_to(ROOT).as_posix()] = data.decode("utf-8")
    return found


def declared(package):
    tree = ET.parse(ROOT / "src" / package / "package.xml")
    return {element.text for element in tree.getroot() if element.tag.endswith("depend")}


def test_there_is_something_to_check():
    assert len(SOURCES) > 50
    assert {"mine_loc_core", "mine_loc_uwb", "mine_loc_pdr", "mine_loc_fusion", "mine_loc_bringup"} <= set(PACKAGES)


@pytest.mark.parametrize(
    "path", [p for p in SOURCES if not is_wiring(p)], ids=lambda p: str(p.relative_to(ROOT / "src"))
)
def test_only_nodes_and_launch_files_import_ros_or_nodes(path):
    ros = {name for name in roots(path) if ROS.fullmatch(name)}
    nodes = {name for name in imports(path) if re.fullmatch(r"mine_loc_\w+\.nodes(\..*)?", name)}
    if package_of(path) == "mine_loc_bringup":
        nodes = {name for name in nodes if not name.startswith("mine_loc_bringup.nodes.")}
    assert not ros | nodes


def test_the_rule_sees_lazy_and_plain_ros_imports(tmp_path):
    file = tmp_path / "lazy.py"
    file.write_text("import numpy\ndef f():\n    from geometry_msgs.msg import Point\n    import rclpy.node\n")
    assert {name for name in roots(file) if ROS.fullmatch(name)} == {"geometry_msgs", "rclpy"}


@pytest.mark.parametrize("package", PACKAGES)
def test_data_flows_one_way_between_packages(package):
    used = {root for path in SOURCES if package_of(path) == package for root in roots(path) if root in ALLOWED}
    assert used - {package} <= ALLOWED[package]
    assert declared(package) & set(ALLOWED) <= ALLOWED[package]


@pytest.mark.parametrize("package", PACKAGES)
def test_what_a_package_imports_is_declared_in_its_package_xml(package):
    used = set()
    for path in SOURCES:
        if package_of(path) == package:
            used |= {
                root for root in roots(path) if root in ROSDEP or ROS.fullmatch(root) or root.startswith("mine_loc_")
            }
    assert {ROSDEP.get(root, root) for root in used - {package}} <= declared(package)
    foreign = {
        root for path in SOURCES if package_of(path) == package for root in roots(path)
        if root not in sys.stdlib_module_names | used | {package} | KEYLESS
    }  # fmt: skip
    assert not foreign


def test_no_file_is_too_long_to_be_read():
    generated = {"requirements.txt", "LICENSE"}
    long = {name: text.count("\n") for name, text in texts().items() if text.count("\n") > MOST_LINES}
    assert {name: lines for name, lines in long.items() if name not in generated} == {}


def test_no_path_of_somebodys_machine_is_written_down():
    own = re.compile(r"(?<![\w.~])/(?:home|root|Users|work)/\w")
    assert {name: own.findall(text) for name, text in texts().items() if own.search(text)} == {}
