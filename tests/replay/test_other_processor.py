"""The same bag on a plainer processor: the libraries are told that ours has no AVX2, AVX-512 or fused multiply-add."""

import math
import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest
from replay.fused_places import places_of

from mine_loc_bringup.offline_run import replay_offline

FOLDER = Path(__file__).parent
MOST_APART_M = 1e-6
PLAIN = {
    "NUMBA_CPU_NAME": "generic",
    "NUMBA_CPU_FEATURES": "",
    "OPENBLAS_CORETYPE": "Nehalem",
    "NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3 AVX512F AVX512CD AVX512_SKX",
    "ATEN_CPU_CAPABILITY": "default",
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F",
}


@pytest.mark.timeout(180)
@pytest.mark.skipif(platform.machine() != "x86_64", reason="the instructions left out are those of x86-64")
@pytest.mark.parametrize("scene", ["walk", "judged_links"])
def test_poses_agree_within_a_micrometre(scene, tmp_path, tmp_path_factory):
    cache = tmp_path_factory.getbasetemp() / "kernels_of_the_plain_processor"
    bag = FOLDER / scene / "bag"
    replay_offline(bag, tmp_path / "ours")
    words = [sys.executable, "-m", "mine_loc_bringup.main", "replay", str(bag), "--out", str(tmp_path / "plain")]
    environment = os.environ | PLAIN | {"NUMBA_CACHE_DIR": str(cache)}
    subprocess.run(words, env=environment, check=True, timeout=150.0, capture_output=True)
    ours, plain = places_of(tmp_path / "ours"), places_of(tmp_path / "plain")
    assert len(ours) > 100
    assert ours.keys() == plain.keys()
    assert max(math.dist(ours[key], plain[key]) for key in ours) < MOST_APART_M
