#include "mine_loc_frame.h"

enum { VERSION = 1, TYPE_RANGES = 1, TYPE_TDOA = 2, TYPE_CIR = 3, SYNC_LENGTH = 2, HEADER_LENGTH = 8, CRC_LENGTH = 2 };

static uint8_t *put(uint8_t *at, uint64_t value, unsigned bytes)
{
    while (bytes--) {
        *at++ = (uint8_t)(value & 0xFFu);
        value >>= 8;
    }
    return at;
}

static uint8_t *put_16(uint8_t *at, uint16_t value) { return put(at, value, 2); }
static uint8_t *put_32(uint8_t *at, uint32_t value) { return put(at, value, 4); }
static uint8_t *put_64(uint8_t *at, uint64_t value) { return put(at, value, 8); }

static uint8_t *put_reception(uint8_t *at, const mine_loc_reception *reception)
{
    at = put_16(at, reception->first_path_index);
    at = put_16(at, reception->first_path_amplitude[0]);
    at = put_16(at, reception->first_path_amplitude[1]);
    at = put_16(at, reception->first_path_amplitude[2]);
    at = put_16(at, reception->noise_std);
    at = put_16(at, reception->receive_power);
    at = put_16(at, reception->preamble_count);
    at = put_16(at, reception->preamble_count_unsaturated);
    *at++ = reception->channel;
    *at++ = reception->prf_mhz;
    *at++ = reception->sfd;
    *at++ = 0;
    return at;
}

/* CRC-16/XMODEM: polynomial 0x1021, initial value 0, not reflected; four bits at a time to keep the table small. */
static uint16_t crc_16(const uint8_t *data, size_t length)
{
    static const uint16_t table[16] = {0x0000, 0x1021, 0x2042, 0x3063, 0x4084, 0x50A5, 0x60C6, 0x70E7,
                                       0x8108, 0x9129, 0xA14A, 0xB16B, 0xC18C, 0xD1AD, 0xE1CE, 0xF1EF};
    uint16_t crc = 0;
    while (length--) {
        crc = (uint16_t)((crc << 4) ^ table[(crc >> 12) ^ (*data >> 4)]);
        crc = (uint16_t)((crc << 4) ^ table[(crc >> 12) ^ (*data & 0x0Fu)]);
        data++;
    }
    return crc;
}

static uint8_t *begin(uint8_t *out, uint8_t type, size_t frame_length, uint16_t frame_number)
{
    out[0] = 0x55;
    out[1] = 0x57;
    out[2] = VERSION;
    out[3] = type;
    put_16(out + 4, (uint16_t)(frame_length - HEADER_LENGTH - CRC_LENGTH));
    return put_16(out + 6, frame_number);
}

static size_t finish(uint8_t *out, size_t frame_length)
{
    size_t covered = frame_length - SYNC_LENGTH - CRC_LENGTH;
    put_16(out + frame_length - CRC_LENGTH, crc_16(out + SYNC_LENGTH, covered));
    return frame_length;
}

size_t mine_loc_encode_ranges(uint8_t *out, size_t capacity, uint16_t frame_number, const mine_loc_round *round,
                              const mine_loc_range *ranges, size_t count)
{
    size_t length = MINE_LOC_RANGES_LENGTH(count);
    if (count > MINE_LOC_MAX_ENTRIES || length > capacity) {
        return 0;
    }
    uint8_t *at = begin(out, TYPE_RANGES, length, frame_number);
    at = put_64(at, round->tag_id);
    at = put_64(at, round->reporter_id);
    at = put_64(at, round->time_us);
    at = put_32(at, round->seq);
    *at++ = round->corrected ? 1 : 0;
    *at++ = (uint8_t)count;
    for (size_t i = 0; i < count; i++) {
        at = put_64(at, ranges[i].anchor_id);
        at = put_32(at, (uint32_t)ranges[i].range_mm);
        at = put_32(at, (uint32_t)ranges[i].offset_us);
        at = put_32(at, (uint32_t)ranges[i].clock_offset_ppb);
        at = put_reception(at, &ranges[i].reception);
    }
    return finish(out, length);
}

size_t mine_loc_encode_tdoa(uint8_t *out, size_t capacity, uint16_t frame_number, const mine_loc_blink *blink,
                            const mine_loc_difference *differences, size_t count)
{
    size_t length = MINE_LOC_TDOA_LENGTH(count);
    if (count > MINE_LOC_MAX_ENTRIES || length > capacity) {
        return 0;
    }
    uint8_t *at = begin(out, TYPE_TDOA, length, frame_number);
    at = put_64(at, blink->tag_id);
    at = put_64(at, blink->reference_anchor_id);
    at = put_64(at, blink->time_us);
    at = put_32(at, blink->seq);
    at = put_16(at, (uint16_t)blink->receive_power_cdbm);
    *at++ = (uint8_t)count;
    *at++ = 0;
    for (size_t i = 0; i < count; i++) {
        at = put_64(at, differences[i].anchor_id);
        at = put_32(at, (uint32_t)differences[i].range_difference_mm);
        at = put_16(at, (uint16_t)differences[i].receive_power_cdbm);
        at = put_16(at, (uint16_t)differences[i].first_path_power_cdbm);
    }
    return finish(out, length);
}

size_t mine_loc_encode_cir(uint8_t *out, size_t capacity, uint16_t frame_number, const mine_loc_cir *cir,
                           const int16_t *taps, size_t count)
{
    size_t length = MINE_LOC_CIR_LENGTH(count);
    if (count > MINE_LOC_MAX_TAPS || cir->start_index > MINE_LOC_MAX_TAPS - count || length > capacity) {
        return 0;
    }
    uint8_t *at = begin(out, TYPE_CIR, length, frame_number);
    at = put_64(at, cir->tag_id);
    at = put_64(at, cir->anchor_id);
    at = put_64(at, cir->time_us);
    at = put_32(at, cir->seq);
    at = put_32(at, (uint32_t)cir->range_mm);
    at = put_reception(at, &cir->reception);
    at = put_16(at, cir->start_index);
    at = put_16(at, (uint16_t)count);
    for (size_t i = 0; i < 2 * count; i++) {
        at = put_16(at, (uint16_t)taps[i]);
    }
    return finish(out, length);
}
