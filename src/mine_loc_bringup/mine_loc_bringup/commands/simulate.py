"""Simulate the hardware of a site: people who walk in it, and every device they and the place have, as bytes.

Opens a pseudo-terminal a device under build/sim/ports (or a TCP port of this host with --tcp), writes a site folder
with these lines to build/sim/site, and plays until Ctrl-C or the end; run the graph beside it with the command line it
prints. The UWB receivers speak their format of site.yaml: mine_loc (for auto too), trek1000 or dwm1001_shell; N100s
speak FDILink; direction-finding monitors report emitters, of which everybody carries one ($MLDF). Same seed, same
bytes. With --bag nothing is played: what the drivers would publish of the bytes is written at once, together with the
truth (truth/<person>/pose, truth/steps, truth/link_state); the site folder lies in the bag's, as mine-loc replay
expects it.

Faults are written KIND@START+DURATION[:DEVICE], with seconds since the beginning:
  noise, truncation, stall, unplug, clock_step     of a line: a receiver's name, person/n100 or monitor_<id>;
                                                   without one of all
  imu_saturation                                   of a person/n100
  frozen_anchor, moved_anchor                      of an anchor's id

Examples:
  mine-loc simulate --site config/example_mine --people 3
  mine-loc simulate --site config/example_mine --people 3 --fault stall@20+0.4:portal --fault unplug@30+5:fitter/n100
  mine-loc simulate --site config/field_15km --people 20 --tcp
  mine-loc simulate --site config/gallery_2km --people 10 --cir --seconds 60 --bag build/gallery
"""

import argparse
import shutil
import threading
import time
from pathlib import Path

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from mine_loc_bringup.site_folder import write_site_folder
from mine_loc_core.errors import ConfigurationError, MineLocError
from mine_loc_core.people import load_people
from mine_loc_core.site import Site, load_site
from mine_loc_core.stamps import NS_PER_S
from mine_loc_sim.byte_streams import byte_blocks
from mine_loc_sim.faults import Fault, moved_anchors, parse_fault
from mine_loc_sim.scenario import Scenario
from mine_loc_sim.scene import SceneOptions, crew, line_formats, line_names
from mine_loc_sim.serial_lines import Ahead, Line, Player, PseudoSerial, TcpBridge

_FIRST_BLOCK_S = 120.0
_POLL_S = 0.2


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("--site", type=Path, required=True, metavar="FOLDER", help="folder of site.yaml and people.yaml")
    add("--people", type=int, required=True, metavar="N", help="the site's first N people, further ones are made up")
    add("--seconds", type=float, default=600.0, metavar="S", help="length of the scene (default 600)")
    add("--speed", type=float, default=1.0, metavar="X", help="play so many times as fast (default 1)")
    add("--seed", type=int, default=1, metavar="K", help="of everything that is drawn (default 1)")
    add("--round-rate", type=float, default=10.0, metavar="HZ", help="ranging rounds of a tag a second (default 10)")
    add("--cir", action="store_true", help="mine_loc receivers send the accumulators too")
    add("--tdoa", action="store_true", help="mine_loc receivers send time differences too")
    add("--fault", action="append", default=[], metavar="FAULT", help="see above; may be given several times")
    add("--tcp", action="store_true", help="TCP ports instead of pseudo-terminals")
    add("--bag", type=Path, metavar="OUT", help="write a bag instead of playing")
    add("--out", type=Path, default=Path("build/sim"), help="folder of ports and site (default build/sim)")


def run(arguments: argparse.Namespace) -> int:
    """Exit status 0 after the whole scene."""
    if not 0.01 <= arguments.speed <= 100.0:
        raise ConfigurationError(f"--speed: {arguments.speed:g}; allowed: 0.01 to 100")
    site = load_site(arguments.site)
    scenario, faults = _scene(site, arguments)
    if arguments.bag:
        return _write_bag(scenario, faults, arguments)
    return _play(scenario, faults, arguments)


def _scene(site: Site, arguments: argparse.Namespace) -> tuple[Scenario, list[Fault]]:
    people = crew(site, tuple(load_people(arguments.site)), arguments.people)
    anchor_ids = [anchor.id for anchor in site.anchors]
    faults = [parse_fault(text, line_names(site, people), anchor_ids) for text in arguments.fault]
    options = SceneOptions(
        seed=arguments.seed,
        seconds=arguments.seconds,
        round_rate_hz=arguments.round_rate,
        cir=arguments.cir,
        tdoa=arguments.tdoa,
        moved_anchors=moved_anchors(faults),
    )
    return Scenario(site, people, options), faults


def _write_bag(scenario: Scenario, faults: list[Fault], arguments: argparse.Namespace) -> int:
    from mine_loc_bringup.nodes.simulation_bag import write_bag  # noqa: PLC0415 only here ROS is needed

    path: Path = arguments.bag
    if path.exists():
        raise ConfigurationError(f"--bag: {path} is there already; allowed: a new name")
    path.parent.mkdir(parents=True, exist_ok=True)
    began_s = time.monotonic()
    with Progress(console=Console(stderr=True)) as progress:
        task = progress.add_task("simulating", total=scenario.options.seconds)
        messages = 0
        for done_ns, written in write_bag(scenario, faults, path):
            messages += written
            progress.update(task, completed=done_ns / NS_PER_S)
    nowhere = {line: f"/dev/null/{line}" for line in scenario.lines}
    write_site_folder(arguments.site, path / "site", nowhere, scenario.people)
    seconds = scenario.options.seconds
    print(f"{path}: {messages} messages, {seconds:g} s in {time.monotonic() - began_s:.1f} s")
    return 0


def _play(scenario: Scenario, faults: list[Fault], arguments: argparse.Namespace) -> int:
    out: Path = arguments.out.resolve()
    shutil.rmtree(out / "ports", ignore_errors=True)
    lines: dict[str, Line] = {
        name: TcpBridge() if arguments.tcp else PseudoSerial(out / "ports" / name.replace("/", "_"))
        for name in scenario.lines
    }
    addresses = {name: line.address for name, line in lines.items()}
    write_site_folder(arguments.site, out / "site", addresses, scenario.people)
    ahead = Ahead(byte_blocks(scenario, faults), lines)
    _print_ports(scenario, addresses, out / "site")
    if not ahead.wait_ready(_FIRST_BLOCK_S):
        raise MineLocError(f"the first block of the scene took longer than {_FIRST_BLOCK_S:g} s")
    players = [Player(line, ahead.arrivals(name), arguments.speed) for name, line in lines.items()]
    start_s = time.monotonic()
    for player in players:
        player.start(start_s)
    silence = threading.Event()
    while not all(player.done for player in players):
        silence.wait(_POLL_S)
    if ahead.problem is not None:
        raise ahead.problem
    print(f"{scenario.options.seconds:g} s played")
    return 0


def _print_ports(scenario: Scenario, addresses: dict[str, str], folder: Path) -> None:
    formats = line_formats(scenario.site, scenario.people)
    table = Table("line", "speaks", "port")
    for name, address in addresses.items():
        table.add_row(name, formats[name], address)
    Console().print(table)
    print(f"run the graph on these lines:\n  mine-loc up --site {folder}", flush=True)
