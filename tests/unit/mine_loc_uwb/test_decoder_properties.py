"""What holds for the decoder of every wire format, on streams of good frames, damaged frames and noise."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_uwb.ranging import CirWindow, Range, RangingRound, TdoaBlink, TdoaDifference
from mine_loc_uwb.wire.detect import FORMATS, make_decoder
from mine_loc_uwb.wire.mine_loc_frame import encode_frame
from mine_loc_uwb.wire.mine_loc_payload import FrameType, encode_cir, encode_ranges, encode_tdoa

TAPS = np.arange(24, dtype=np.int16)
CIR = CirWindow(7, 0xA1, 3, 99, 4.5, 745.25, 730, 101, 42.0, (1404, 1657, 1179), 10_854, 5, 64, TAPS, -TAPS)
FRAMES = {
    "trek1000": [
        b"mr 0f 000005a4 000004c8 00000436 000003f9 0958 c0 40424042 a0:0\r\n",
        b"mc 0f 00000663 000005a3 00000512 000004cb 095f c1 00024c24 a0:0\n",
        b"ma 07 00000000 0000085c 00000659 000006b7 095b 26 00024bed a0:0\r\n",
    ],
    "dwm1001_shell": [
        b"DIST,2,AN0,022E,7.94,8.03,0.00,3.44,AN1,9280,7.95,0.00,0.00,5.68,POS,6.95,5.37,-1.97,52\r\n",
        b"022E[7.94,8.03,0.00]=3.38 9280[7.95,0.00,0.00]=5.49 le_us=3082 est[6.97,5.17,-1.77,53]\r\n",
        b"POS,7.10,5.24,-2.03,53\r\n",
    ],
    "dwm1001_tlv": [
        bytes.fromhex(
            "40 01 00 41 0d ba 04 00 00 ce ff ff ff fb 00 00 00 57 49 15 01"
            "2e 02 70 0d 00 00 64 04 1f 00 00 5e 1f 00 00 00 00 00 00 64"
        ),
        bytes.fromhex(
            "40 01 00 41 0d ba 04 00 00 ce ff ff ff fb 00 00 00 57 48 0e 01 80 92 00 00 00 00 ca de 30 16 00 00 64"
        ),
    ],
    "arduino": [
        b"from: 1782\t Range: 1.23 m\t RX power: -78.45 dBm\r\n",
        b'{"links":[{"A":"1782","R":"1.2"},{"A":"1783","R":"10.0"}]}',
        b"T:144235622:RR:0:2:950:950:118:1910\r\n",
        b"Distance : 2.345678\r\n",
    ],
    "nlink": [
        bytes.fromhex(
            "55 05 24 00 02 03 40 e2 01 00 f1 fb 09 00 00 00 00 00 92 13 0201 00 70 0d 00 a3 9e 01 01 17 2f 00 be a9 b0"
        ),
        bytes.fromhex("55 05 16 00 02 03 40 e2 01 00 f1 fb 09 00 00 00 00 00 92 13 00 32"),
    ],
    "mine_loc": [
        encode_frame(
            FrameType.RANGES, 0, encode_ranges(RangingRound(1, 2, 3, 4, (Range(5, 6.0),) * 2, corrected=False))
        ),
        encode_frame(FrameType.TDOA, 1, encode_tdoa(TdoaBlink(1, 2, 3, 4, -80.0, (TdoaDifference(5, 6.0),)))),
        encode_frame(FrameType.CIR, 2, encode_cir(CIR)),
    ],
}
FLUSH = {"mine_loc": bytes(4200), "dwm1001_tlv": bytes(300), "nlink": bytes(500)}
"""What completes any frame that damage pretends to begin; a line end does so in text."""

every_format = pytest.mark.parametrize("name", FORMATS)


@st.composite
def damaged(draw, frames):
    frame = draw(st.sampled_from(frames))
    start, end = sorted((draw(st.integers(0, len(frame))), draw(st.integers(0, len(frame)))))
    return frame[:start] + draw(st.binary(max_size=8)) + frame[end:]


def streams(name):
    piece = st.one_of(st.sampled_from(FRAMES[name]), damaged(FRAMES[name]), st.binary(max_size=40))
    return st.lists(piece, max_size=12).map(b"".join)


@every_format
def test_each_frame_of_a_clean_stream_gives_one_message_and_no_loss(name):
    decoder = make_decoder(name)
    assert len(decoder.feed(b"".join(FRAMES[name]))) == len(FRAMES[name])
    assert not decoder.losses


@every_format
@given(data=st.data(), sizes=st.lists(st.integers(1, 60), min_size=1, max_size=5))
def test_chunking_changes_neither_messages_nor_losses(name, data, sizes):
    stream = data.draw(streams(name))
    whole, chunked = make_decoder(name), make_decoder(name)
    expected = whole.feed(stream)
    messages, rest = [], stream
    while rest:
        for size in sizes:
            messages += chunked.feed(rest[:size])
            rest = rest[size:]
    assert list(map(str, messages)) == list(map(str, expected))
    assert chunked.losses == whole.losses


@every_format
@given(data=st.data())
def test_good_frames_after_any_damage_are_found(name, data):
    decoder, reference = make_decoder(name), make_decoder(name)
    decoder.feed(data.draw(streams(name)) + FLUSH.get(name, b"\n"))
    good = b"".join(FRAMES[name])
    messages = decoder.feed(good + FLUSH.get(name, b"\n"))
    assert list(map(str, messages[-len(FRAMES[name]) :])) == list(map(str, reference.feed(good)))


@every_format
@given(noise=st.lists(st.integers(0x80, 0xFF), min_size=1, max_size=60).map(bytes))
def test_noise_yields_no_message_and_is_counted(name, noise):
    decoder = make_decoder(name)
    assert decoder.feed(noise + FLUSH.get(name, b"\n")) == []
    assert decoder.losses


@every_format
def test_a_partial_frame_does_not_outlive_a_reset(name):
    decoder, frame = make_decoder(name), FRAMES[name][0]
    decoder.feed(frame[: len(frame) // 2])
    decoder.reset()
    assert len(decoder.feed(frame)) == 1
    assert sum(decoder.losses.values()) > 0
