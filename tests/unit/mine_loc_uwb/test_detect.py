import pytest

from mine_loc_core.errors import ConfigurationError
from mine_loc_uwb.ranging import Range, RangingRound
from mine_loc_uwb.wire.detect import FORMATS, AutoDetect, make_decoder
from mine_loc_uwb.wire.mine_loc_frame import encode_frame
from mine_loc_uwb.wire.mine_loc_payload import FrameType, encode_ranges

TREK = b"mc 0f 00000663 000005a3 00000512 000004cb 095f c1 00024c24 a0:0\r\n"
SAMPLES = {
    "trek1000": TREK,
    "dwm1001_shell": b"DIST,1,AN0,022E,7.94,8.03,0.00,3.44,POS,6.95,5.37,-1.97,52\r\n",
    "dwm1001_tlv": bytes.fromhex(
        "40 01 00 41 0d ba 04 00 00 ce ff ff ff fb 00 00 00 57 49 15 01"
        "2e 02 70 0d 00 00 64 04 1f 00 00 5e 1f 00 00 00 00 00 00 64"
    ),
    "arduino": b"from: 1782\t Range: 1.23 m\t RX power: -78.45 dBm\r\n",
    "nlink": bytes.fromhex(
        "55 05 24 00 02 03 40 e2 01 00 f1 fb 09 00 00 00 00 00 92 13 02 01 00 70 0d 00 a3 9e 01 01 17 2f 00 be a9 b0"
    ),
    "mine_loc": encode_frame(
        FrameType.RANGES, 0, encode_ranges(RangingRound(1, 1, 1, 1, (Range(2, 3.0),), corrected=False))
    ),
}


def test_there_is_a_sample_of_every_format():
    assert tuple(SAMPLES) == FORMATS


def test_an_unknown_name_is_refused_with_the_allowed_ones():
    with pytest.raises(ConfigurationError, match=r"'lora' is unknown; allowed: trek1000, .*, mine_loc"):
        make_decoder("lora")


@pytest.mark.parametrize("name", FORMATS)
def test_the_format_is_found_and_nothing_is_lost(name):
    detector, named = AutoDetect(), make_decoder(name)
    stream = SAMPLES[name] * 5
    expected = named.feed(stream)
    received = [message for byte in stream for message in detector.feed(bytes((byte,)))]
    assert repr(received) == repr(expected)
    assert len(expected) == 5
    assert detector.name == name
    assert (detector.tick_period_s, detector.counter_bits, detector.seq_bits) == (
        named.tick_period_s,
        named.counter_bits,
        named.seq_bits,
    )
    assert detector.losses == named.losses


@pytest.mark.parametrize("name", FORMATS)
def test_the_format_is_found_after_noise(name):
    detector = AutoDetect()
    noise = bytes(range(256)) * 8 + b"\r\n"
    detector.feed(noise)
    filler = SAMPLES[name] * 200
    assert len(detector.feed(filler)) >= 100
    assert detector.name == name


def test_nothing_is_decided_before_a_clear_lead():
    detector = AutoDetect()
    assert detector.feed(SAMPLES["trek1000"] * 2) == []
    assert detector.name == "undecided"
    assert detector.tick_period_s == 0


def test_two_devices_on_one_line_are_not_decided_and_the_memory_stays_bounded():
    detector = AutoDetect()
    both = SAMPLES["trek1000"] + SAMPLES["arduino"]
    for _ in range(2 * AutoDetect.MAX_HELD):
        assert detector.feed(both) == []
    assert max(map(len, detector._held.values())) == AutoDetect.MAX_HELD
    messages = detector.feed(SAMPLES["trek1000"] * 3)
    assert len(messages) == AutoDetect.MAX_HELD
    assert detector.losses["undecided_overflow"] == AutoDetect.MAX_HELD + 3


def test_after_a_reset_another_device_is_recognised():
    detector = AutoDetect()
    detector.feed(SAMPLES["trek1000"] * 3 + b"garbage\n")
    assert detector.losses == {"unrecognised_line": 1}
    detector.reset()
    assert detector.name == "undecided"
    assert len(detector.feed(SAMPLES["arduino"] * 3)) == 3
    assert detector.name == "arduino"
    assert detector.losses == {"unrecognised_line": 1}
