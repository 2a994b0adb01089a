"""The site folder of a recording."""

from pathlib import Path

import yaml

from mine_loc_bringup.recordings.recording import Recording
from mine_loc_core.people import load_people
from mine_loc_core.site import load_site


def write_site(recording: Recording, source: str, folder: Path) -> None:
    """Write site.yaml and people.yaml; `source` is where the recording comes from.

    They are read back, so that what is wrong shows here and not in a replay: raises ConfigurationError.
    """
    folder.mkdir(parents=True, exist_ok=True)
    heading = f"# Of the recording {recording.name} from {source}; lines of devices are not used.\n"
    for name, content in (("site", recording.site), ("people", {"schema": 1, "people": list(recording.people)})):
        text = heading + yaml.safe_dump(content, sort_keys=False, default_flow_style=None)
        (folder / f"{name}.yaml").write_text(text, "utf-8")
    load_site(folder)
    load_people(folder)
