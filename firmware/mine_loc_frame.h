/* Encoder of the mine_loc frame for the host microcontroller of a DW1000 module.
 *
 * C99, no allocation, no floating point, no dependence on byte order. The format is specified in docs/wire-formats.md.
 * Every encoder returns the length written, or 0 when the frame does not fit into `capacity` or breaks a limit.
 */
#ifndef MINE_LOC_FRAME_H
#define MINE_LOC_FRAME_H

#include <stddef.h>
#include <stdint.h>

#define MINE_LOC_MAX_ENTRIES 64u
#define MINE_LOC_MAX_TAPS 1016u

/* Lengths of whole frames, to size buffers with. */
#define MINE_LOC_RANGES_LENGTH(count) (40u + 40u * (size_t)(count))
#define MINE_LOC_TDOA_LENGTH(count) (42u + 16u * (size_t)(count))
#define MINE_LOC_CIR_LENGTH(count) (66u + 4u * (size_t)(count))

/* Not reported: these in signed fields, 0 in unsigned ones. */
#define MINE_LOC_NONE_32 INT32_MIN
#define MINE_LOC_NONE_16 INT16_MIN

enum mine_loc_sfd {
    MINE_LOC_SFD_UNKNOWN = 0,
    MINE_LOC_SFD_STANDARD_8 = 1,
    MINE_LOC_SFD_STANDARD_64 = 2,
    MINE_LOC_SFD_DECAWAVE_8 = 3,
    MINE_LOC_SFD_DECAWAVE_16 = 4,
    MINE_LOC_SFD_DECAWAVE_64 = 5
};

/* Diagnostic registers of one reception, as read from the DW1000. */
typedef struct {
    uint16_t first_path_index;           /* FP_INDEX, 1/64 tap */
    uint16_t first_path_amplitude[3];    /* FP_AMPL1..3 */
    uint16_t noise_std;                  /* STD_NOISE */
    uint16_t receive_power;              /* CIR_PWR */
    uint16_t preamble_count;             /* RXPACC */
    uint16_t preamble_count_unsaturated; /* RXPACC_NOSAT */
    uint8_t channel;
    uint8_t prf_mhz; /* 16 or 64 */
    uint8_t sfd;     /* enum mine_loc_sfd */
} mine_loc_reception;

typedef struct {
    uint64_t tag_id;      /* not 0 */
    uint64_t reporter_id; /* unit on whose serial line this goes out; 0 = unknown */
    uint64_t time_us;     /* device clock at the round; 0 = none */
    uint32_t seq;         /* counts rounds */
    uint8_t corrected;    /* 1 = the range bias is already subtracted */
} mine_loc_round;

typedef struct {
    uint64_t anchor_id; /* not 0 */
    int32_t range_mm;   /* MINE_LOC_NONE_32 = the exchange failed */
    int32_t offset_us;  /* instant of this exchange minus time_us of the round */
    int32_t clock_offset_ppb;
    mine_loc_reception reception;
} mine_loc_range;

typedef struct {
    uint64_t tag_id;              /* not 0 */
    uint64_t reference_anchor_id; /* not 0 */
    uint64_t time_us;             /* clock of the reference anchor at the blink */
    uint32_t seq;                 /* counts blinks */
    int16_t receive_power_cdbm;   /* at the reference anchor, 1/100 dBm */
} mine_loc_blink;

typedef struct {
    uint64_t anchor_id;          /* not 0 */
    int32_t range_difference_mm; /* distance to this anchor minus distance to the reference */
    int16_t receive_power_cdbm;
    int16_t first_path_power_cdbm;
} mine_loc_difference;

typedef struct {
    uint64_t tag_id;    /* not 0 */
    uint64_t anchor_id; /* not 0 */
    uint64_t time_us;
    uint32_t seq; /* of the round this reception belongs to */
    int32_t range_mm;
    mine_loc_reception reception;
    uint16_t start_index; /* of the first tap in the whole accumulator */
} mine_loc_cir;

/* `frame_number` counts all frames of one serial line and wraps. */
size_t mine_loc_encode_ranges(uint8_t *out, size_t capacity, uint16_t frame_number, const mine_loc_round *round,
                              const mine_loc_range *ranges, size_t count);

size_t mine_loc_encode_tdoa(uint8_t *out, size_t capacity, uint16_t frame_number, const mine_loc_blink *blink,
                            const mine_loc_difference *differences, size_t count);

/* `taps` holds count pairs of in-phase and quadrature, as read from register file 0x25 without the dummy byte. */
size_t mine_loc_encode_cir(uint8_t *out, size_t capacity, uint16_t frame_number, const mine_loc_cir *cir,
                           const int16_t *taps, size_t count);

#endif
