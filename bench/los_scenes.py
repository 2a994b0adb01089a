"""Labelled accumulators of simulated walks: people with tags in a mine, each link with its class."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mine_loc_core.people import load_people
from mine_loc_core.site import load_site
from mine_loc_sim.reports import ReportedCir
from mine_loc_sim.scenario import Block, Scenario
from mine_loc_sim.scene import SceneOptions, crew
from mine_loc_uwb.cir_frames import CirFrames, concatenate
from mine_loc_uwb.labelled_frames import LabelledFrames
from mine_loc_uwb.ranging import CirWindow

CONFIG = Path(__file__).parent.parent / "config"
_ROUND_RATE_HZ = 10.0


@dataclass(frozen=True, slots=True)
class Scene:
    """A site and how many people walk there for how long."""

    site: str
    people: int
    seconds: float


TRAINING_SCENES = (Scene("gallery_2km", 30, 30.0), Scene("vehicle", 6, 30.0))
TEST_SCENES = (Scene("example_mine", 10, 20.0),)


def walk_frames(scene: Scene, seed: int) -> LabelledFrames:
    """Play a scene and keep every accumulator with the class of its link."""
    folder = CONFIG / scene.site
    site = load_site(folder)
    people = crew(site, tuple(load_people(folder)), scene.people)
    options = SceneOptions(seed=seed, seconds=scene.seconds, round_rate_hz=_ROUND_RATE_HZ, cir=True)
    tags = {person.name: person.tag_id for person in people}
    frames, classes, links, stamps = [], [], [], []
    for block in Scenario(site, people, options).blocks():
        truth = {(link.stamp_ns, tags[link.person], link.anchor_id): link.link_class for link in block.links}
        heard = [(stamp_ns, frame.window) for stamp_ns, frame in _reports(block)]
        if heard:
            frames.append(_frames([window for _, window in heard]))
            links += [(window.tag_id, window.anchor_id) for _, window in heard]
            stamps += [stamp_ns for stamp_ns, _ in heard]
            classes += [truth[stamp_ns, window.tag_id, window.anchor_id] for stamp_ns, window in heard]
    numbers = {link: number for number, link in enumerate(dict.fromkeys(links))}
    return LabelledFrames(
        concatenate(frames),
        np.array(classes)[:, None] == np.arange(1, 5),
        np.array([numbers[link] for link in links]),
        links,
        np.array(stamps),
    )


def _reports(block: Block) -> list[tuple[int, ReportedCir]]:
    """In order of time; a tag speaks over one line at a time."""
    found = [item for line in block.frames.values() for item in line if isinstance(item[1], ReportedCir)]
    return sorted(found, key=lambda item: item[0])  # type: ignore[arg-type, return-value]


def _frames(windows: list[CirWindow]) -> CirFrames:
    def column(name: str) -> np.ndarray:
        return np.array([getattr(window, name) for window in windows], float)

    return CirFrames(
        samples=np.stack([np.stack([window.in_phase, window.quadrature], axis=-1) for window in windows]),
        start_index=column("start_index").astype(int),
        first_path_index=column("first_path_index"),
        symbols=column("preamble_count"),
        noise_std=column("noise_std"),
        receive_power_dbm=column("receive_power_dbm"),
        first_path_power_dbm=column("first_path_power_dbm"),
        range_m=column("range_m"),
        channel=column("channel").astype(int),
    )
