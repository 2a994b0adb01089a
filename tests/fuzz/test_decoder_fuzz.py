"""Hostile bytes for every decoder: noise, and the corpus cut, flipped, doubled and spliced.

MINE_LOC_FUZZ_BYTES sets the number of bytes, spread over all decoders; the seed is fixed, so a failure repeats.
"""

import os
import random
from functools import partial
from pathlib import Path

import pytest

from mine_loc_coarse import monitor_protocol
from mine_loc_uwb.wire.detect import FORMATS, AutoDetect, make_decoder

CORPUS = {path.stem: path.read_bytes() for path in sorted(Path(__file__).with_name("corpus").glob("*.bin"))}
DECODERS = {f"uwb_{name}": partial(make_decoder, name) for name in FORMATS} | {"monitor": monitor_protocol.decoder}
TOTAL_BYTES = int(os.environ.get("MINE_LOC_FUZZ_BYTES", "1000000"))
NAMES = (*DECODERS, "auto")
BURST = 20_000
FLUSH = bytes(4200) + b"\r\n"
"""Completes any frame a decoder may be waiting for."""


def mutate(source, rng):
    """A few of the ways in which a serial line damages what it carries."""
    data = bytearray(source)
    for _ in range(rng.randrange(1, 12)):
        start = rng.randrange(len(data) + 1)
        end = min(len(data), start + rng.randrange(1, 40))
        damage = rng.randrange(5)
        if damage == 0:
            del data[start:end]
        elif damage == 1:
            data[start:start] = data[start:end]
        elif damage == 2:
            data[start:end] = rng.randbytes(end - start)
        elif damage == 3 and start < len(data):
            data[start] ^= 1 << rng.randrange(8)
        else:
            data[start:start] = rng.randbytes(rng.randrange(40))
    return bytes(data)


def burst(rng):
    """About BURST bytes of noise and damaged frames of all formats, so that starts of any kind occur."""
    data = bytearray()
    while len(data) < BURST:
        data += rng.randbytes(rng.randrange(400)) if rng.random() < 0.3 else mutate(rng.choice([*CORPUS.values()]), rng)
    return bytes(data)


def feed_in_chunks(decoder, data, rng):
    offset = 0
    while offset < len(data):
        size = rng.choice((1, 7, 64, 512, 5000))
        decoder.feed(data[offset : offset + size])
        offset += size


def test_the_corpus_has_a_file_for_every_format():
    assert set(CORPUS) == set(DECODERS)


@pytest.mark.timeout(900)
@pytest.mark.parametrize("name", NAMES)
def test_hostile_bytes_neither_raise_nor_blind_the_decoder(name):
    rng = random.Random(f"fuzz {name}")
    fed = 0
    while fed < TOTAL_BYTES / len(NAMES):
        decoder = AutoDetect() if name == "auto" else DECODERS[name]()
        data = burst(rng)
        feed_in_chunks(decoder, data, rng)
        fed += len(data)
        if name == "auto":
            continue
        assert decoder.losses, "a burst of damage must be counted"
        decoder.feed(FLUSH)
        good = CORPUS[name]
        assert list(map(str, decoder.feed(good)))[-3:] == list(map(str, DECODERS[name]().feed(good)))[-3:]
