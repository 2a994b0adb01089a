"""The public recordings that `mine-loc import` knows."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from mine_loc_bringup.recordings import hanyang, ipol, isas, trek1000, uwb_cirs
from mine_loc_bringup.recordings.recording import Recording


@dataclass(frozen=True, slots=True)
class Importer:
    """How a set is read: the `names` of its recordings in a folder, and one of them.

    `source` is where it was published, `alignment` what `mine-loc evaluate` needs to compare with its truth.
    """

    source: str
    names: Callable[[Path], list[str]]
    load: Callable[[Path, str], Recording]
    alignment: str = ""


IMPORTERS: Mapping[str, Importer] = {
    "trek1000": Importer(
        "https://github.com/cliansang/positioning-algorithms-for-uwb-matlab",
        trek1000.names,
        trek1000.load,
        "--align rigid --apply-time-offset",
    ),
    "hanyang": Importer("https://github.com/cucudasluv/UWB-dataset", hanyang.names, hanyang.load),
    "isas": Importer("https://github.com/KIT-ISAS/SFUISE", isas.names, isas.load, "--align rigid"),
    "ipol": Importer("https://github.com/CyrilVoisard/ipol_dataset_1", ipol.names, ipol.load),
    "uwb-cirs": Importer("https://github.com/marckolak/uwb-cirs-2018", uwb_cirs.names, uwb_cirs.load),
}
