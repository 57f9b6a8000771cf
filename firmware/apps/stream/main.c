/* The identifier behind a serial link: the PC configures it; samples come from the PC, or the board samples by
 * itself (field mode); the board steps and answers with running hashes, estimates and its status. Frames: link.h and
 * schema.h; what they mean: host/src/pvid/link.py.
 *
 * From the PC no sample is lost: samples are numbered, only the next one is taken, and each credit says which that is
 * and how many may be under way. What a line swallows or spoils is sent again; what comes twice is counted and left
 * out. Every answer carries the session number of the configuration, so that a board that has restarted is noticed, and
 * 48 bits of the tick: the header's 32 are passed in 50 days at 1 kHz.
 *
 * In field mode each sample goes to the PC exactly as the identifier gets it, before the hash or the estimate that it
 * is part of. In time (PVID_SOURCE_SENSOR) nothing waits for the line: a frame that does not fit is dropped, and the
 * PC counts it. What a PC that joins late has to know is said again every ANNOUNCE_S seconds.
 *
 * stream_rig.h (pvid.stream_image makes it) holds the settings and tables; Configure brings the start and the law.
 * The PC's Configure is refused when it was made for other settings. The host runs the same program on a
 * pseudo-terminal (ports/host).
 */
#include <string.h>

#include "answers.h"
#include "identifier.h"
#include "link.h"
#include "port.h"
#include "receiver.h"
#include "pvid/little_endian.h"
#include "sensor.h"

#define WINDOW 256u      /* samples that may be under way */
#define RAW_SAMPLES 32u  /* that go to the PC in a frame */
#define ANSWER_ROOM 640u /* all that one sample or one question may be answered with, but for announcements */
#define CHUNK 64u
#define ANNOUNCE_S 4u

#define PERIOD_NS ((uint32_t)(1.0e9f / STREAM_SAMPLE_RATE))
#define BACKLOG_NS 1000000000u /* of samples that are due: what is more is not taken any more */
#define ANNOUNCE_TICKS ((uint32_t)((float)ANNOUNCE_S * STREAM_SAMPLE_RATE))

/* Both cores' Configure begin alike. */
typedef char configurations_begin_alike[((PVID_CONFIGURE_SESSION == PVID_CONFIGURE_Q31_SESSION) &&
                                         (PVID_CONFIGURE_SETTINGS == PVID_CONFIGURE_Q31_SETTINGS) &&
                                         (PVID_CONFIGURE_FORM == PVID_CONFIGURE_Q31_FORM) &&
                                         (PVID_CONFIGURE_SOURCE == PVID_CONFIGURE_Q31_SOURCE) &&
                                         (PVID_CONFIGURE_HASH_EVERY == PVID_CONFIGURE_Q31_HASH_EVERY) &&
                                         (PVID_CONFIGURE_ESTIMATE_EVERY == PVID_CONFIGURE_Q31_ESTIMATE_EVERY))
                                            ? 1
                                            : -1];

/* What is still to be announced, in this order. */
#define DUE_HELLO 1u
#define DUE_SCHEMA 2u
#define DUE_CONFIGURATION 4u
#define DUE_STATUS 8u
#define DUE_ALL 15u

static struct {
    answers out;
    pvid_link_decoder decoder;
    uint8_t due;
    uint8_t configuration[IDENTIFIER_CONFIGURE_BYTES]; /* in force */
    uint32_t session;
    uint8_t code;
    uint8_t source;
    pvid_status core;
    uint16_t hash_every;
    uint16_t estimate_every;
    uint32_t ticks;     /* samples worked off: the number of the next one, its lower bits */
    uint16_t tick_high; /* and the bits above them */
    uint32_t hash;
    uint32_t sample_hash; /* of the samples themselves */
    pvid_reason reason;   /* of the last tick */
    pvid_reason verdict;  /* of the last one that was more than a row accumulated */
    uint32_t repeated;
    uint32_t skipped;
    pvid_link_frame samples; /* the frame in work */
    uint32_t taken;          /* of its samples */
    uint32_t count;          /* of its samples; 0: none is in work */
} stream;

static struct {
    uint32_t clock_us; /* at the last look */
    uint32_t due_ns;   /* time that has passed and is not sampled yet */
    uint32_t count;    /* samples in frame, the last ones before stream.ticks */
    uint8_t frame[IDENTIFIER_RAW_BYTES + (SAMPLE_BYTES * RAW_SAMPLES)]; /* of samples, its payload */
} field;

/* ---- answers */

static void answer(uint8_t type, const uint8_t payload[], size_t length)
{
    answers_put(&stream.out, type, stream.ticks, payload, length);
}

static void answer_hello(void)
{
    static const char board[] = PVID_BOARD_NAME;
    static const float p_unit[LINK_MAX_P] = STREAM_P_UNIT;
    uint8_t payload[PVID_HELLO_BYTES];
    memset(payload, 0, sizeof payload);
    payload[PVID_HELLO_FORM] = STREAM_FORM;
    payload[PVID_HELLO_CORE] = STREAM_CORE;
    payload[PVID_HELLO_N_P] = STREAM_N_P;
    pvid_put_u16(&payload[PVID_HELLO_WINDOW], WINDOW);
    pvid_put_u32(&payload[PVID_HELLO_SETTINGS], STREAM_SETTINGS);
    pvid_put_u32(&payload[PVID_HELLO_SESSION], stream.session);
    pvid_put_f32(&payload[PVID_HELLO_SAMPLE_RATE], STREAM_SAMPLE_RATE);
    pvid_put_f32(&payload[PVID_HELLO_PHI_LSB], STREAM_PHI_LSB);
    pvid_put_f32(&payload[PVID_HELLO_Y_LSB], STREAM_Y_LSB);
    for (size_t i = 0; i < LINK_MAX_P; i++) {
        pvid_put_f32(&payload[PVID_HELLO_P_UNIT + (4u * i)], p_unit[i]);
    }
    for (size_t i = 0; (i < (sizeof board - 1u)) && (i < (PVID_HELLO_TICK_HIGH - PVID_HELLO_BOARD)); i++) {
        payload[PVID_HELLO_BOARD + i] = (uint8_t)board[i];
    }
    pvid_put_u16(&payload[PVID_HELLO_TICK_HIGH], stream.tick_high);
    answer(PVID_HELLO, payload, sizeof payload);
}

static void answer_status(void)
{
    const pvid_counters *counters = identifier_counters();
    const pvid_link_counters *received = &stream.decoder.counters;
    uint8_t payload[PVID_STATUS_BYTES];
    pvid_put_u32(&payload[PVID_STATUS_SESSION], stream.session);
    payload[PVID_STATUS_CODE] = stream.code;
    payload[PVID_STATUS_CORE] = (uint8_t)stream.core;
    pvid_put_u32(&payload[PVID_STATUS_UPDATES], counters->updates);
    pvid_put_u32(&payload[PVID_STATUS_REJECTED], counters->rejected_not_finite + counters->rejected_saturated);
    pvid_put_u32(&payload[PVID_STATUS_REPEATED], stream.repeated);
    pvid_put_u32(&payload[PVID_STATUS_SKIPPED], stream.skipped);
    pvid_put_u32(&payload[PVID_STATUS_MISSING], received->missing);
    pvid_put_u32(&payload[PVID_STATUS_MALFORMED], received->malformed);
    pvid_put_u32(&payload[PVID_STATUS_BAD_CRC], received->bad_crc);
    pvid_put_u32(&payload[PVID_STATUS_FOREIGN], received->foreign);
    pvid_put_u16(&payload[PVID_STATUS_TICK_HIGH], stream.tick_high);
    answer(PVID_STATUS, payload, sizeof payload);
}

static void answer_credit(void)
{
    uint8_t payload[PVID_CREDIT_BYTES];
    pvid_put_u32(&payload[PVID_CREDIT_SESSION], stream.session);
    pvid_put_u32(&payload[PVID_CREDIT_ROOM], WINDOW);
    pvid_put_u32(&payload[PVID_CREDIT_HASH], stream.hash);
    pvid_put_u32(&payload[PVID_CREDIT_SAMPLE_HASH], stream.sample_hash);
    payload[PVID_CREDIT_REASON] = (uint8_t)stream.reason;
    pvid_put_u16(&payload[PVID_CREDIT_TICK_HIGH], stream.tick_high);
    answer(PVID_CREDIT, payload, sizeof payload);
}

static void answer_hash(void)
{
    uint8_t payload[PVID_HASH_BYTES];
    pvid_put_u32(&payload[PVID_HASH_SESSION], stream.session);
    pvid_put_u32(&payload[PVID_HASH_HASH], stream.hash);
    pvid_put_u32(&payload[PVID_HASH_SAMPLE_HASH], stream.sample_hash);
    pvid_put_u16(&payload[PVID_HASH_TICK_HIGH], stream.tick_high);
    answer(PVID_HASH, payload, sizeof payload);
}

static void answer_estimate(void)
{
    uint8_t payload[IDENTIFIER_ESTIMATE_BYTES];
    identifier_estimate(payload, stream.session, stream.verdict);
    pvid_put_u16(&payload[IDENTIFIER_ESTIMATE_TICK_HIGH], stream.tick_high);
    answer(IDENTIFIER_ESTIMATE, payload, sizeof payload);
}

static void answer_raw(void)
{
    if (field.count > 0u) {
        const bool wrapped = stream.ticks < field.count; /* since the first of them */
        pvid_put_u32(&field.frame[IDENTIFIER_RAW_SESSION], stream.session);
        pvid_put_u16(&field.frame[IDENTIFIER_RAW_TICK_HIGH], (uint16_t)(stream.tick_high - (wrapped ? 1u : 0u)));
        answers_put(&stream.out,
                    IDENTIFIER_RAW,
                    stream.ticks - field.count,
                    field.frame,
                    IDENTIFIER_RAW_BYTES + (SAMPLE_BYTES * field.count));
        field.count = 0;
    }
}

static bool running(void)
{
    return stream.code == PVID_CODE_RUNNING;
}

static bool sampling(void)
{
    return running() && (stream.source != PVID_SOURCE_PC);
}

/* Says one of the things that are due, as soon as there is room for it. */
static void announce(void)
{
    static const char schema[] = PVID_LINK_SCHEMA_TEXT;
    const uint8_t first = (uint8_t)(stream.due & (0u - stream.due));
    const size_t room = (first == DUE_SCHEMA) ? PVID_LINK_ENCODED_BYTES(sizeof schema - 1u) : ANSWER_ROOM;
    if ((first == 0u) || !answers_fit(&stream.out, room)) {
        return;
    }
    stream.due = (uint8_t)(stream.due - first);
    if (first == DUE_HELLO) {
        answer_hello();
    } else if (first == DUE_SCHEMA) {
        answer(PVID_SCHEMA, (const uint8_t *)schema, sizeof schema - 1u);
    } else if (first == DUE_STATUS) {
        answer_raw(); /* whose ticks come before the status's */
        answer_status();
    } else if (sampling()) {
        answer(IDENTIFIER_CONFIGURE, stream.configuration, sizeof stream.configuration);
    } else {
        /* the PC knows what it configured */
    }
}

/* ---- steps */

static void step(const uint8_t sample[SAMPLE_BYTES])
{
    stream.reason = identifier_step(sample);
    if (stream.reason != PVID_ACCUMULATED) {
        stream.verdict = stream.reason;
    }
    stream.hash = identifier_hash(stream.hash, stream.reason);
    for (size_t at = 0; at < SAMPLE_BYTES; at += 4u) {
        stream.sample_hash = pvid_fnv_word(stream.sample_hash, pvid_get_u32(&sample[at]));
    }
    stream.ticks++;
    if (stream.ticks == 0u) {
        stream.tick_high++;
    }
    const bool hash_due = (stream.hash_every != 0u) && ((stream.ticks % stream.hash_every) == 0u);
    const bool estimate_due = (stream.estimate_every != 0u) && ((stream.ticks % stream.estimate_every) == 0u);
    if (hash_due || estimate_due || (field.count == RAW_SAMPLES)) {
        answer_raw();
    }
    if (hash_due) {
        answer_hash();
    }
    if (estimate_due) {
        answer_estimate();
    }
}

/* The next sample of the frame in work. */
static void step_sent(void)
{
    step(&stream.samples.payload[SAMPLE_BYTES * stream.taken]);
    stream.taken++;
    if (stream.taken == stream.count) {
        stream.count = 0;
        answer_credit();
    }
}

/* The next sample of the board's own sensor. */
static void step_field(void)
{
    int32_t counts[2];
    uint8_t *sample = &field.frame[IDENTIFIER_RAW_BYTES + (SAMPLE_BYTES * field.count)];
    sensor_read(counts);
    identifier_sample(counts, sample);
    field.count++;
    step(sample);
    if ((stream.ticks % ANNOUNCE_TICKS) == 0u) {
        stream.due = DUE_ALL;
    }
}

/* Whether it is time for a sample of the board's own: in time, or as soon as all that it may be answered with fits. */
static bool sample_due(bool room)
{
    if (stream.source == PVID_SOURCE_SENSOR_PACED) {
        return room && (stream.due == 0u);
    }
    const uint32_t now = pvid_port_microseconds();
    const uint32_t passed_us = now - field.clock_us;
    field.clock_us = now;
    const uint32_t room_us = (BACKLOG_NS - field.due_ns) / 1000u;
    field.due_ns += 1000u * ((passed_us < room_us) ? passed_us : room_us);
    if (field.due_ns < PERIOD_NS) {
        return false;
    }
    field.due_ns -= PERIOD_NS;
    return true;
}

/* ---- what comes from the PC */

static void start_over(const uint8_t payload[IDENTIFIER_CONFIGURE_BYTES])
{
    stream.core = identifier_start(payload);
    stream.code = (stream.core == PVID_OK) ? PVID_CODE_RUNNING : PVID_CODE_REFUSED_BY_CORE;
    if (sampling()) {
        memcpy(stream.configuration, payload, sizeof stream.configuration);
        stream.due = DUE_ALL;
        sensor_start();
        field.clock_us = pvid_port_microseconds();
        field.due_ns = 0;
    }
}

static void configure(const uint8_t payload[IDENTIFIER_CONFIGURE_BYTES])
{
    const uint32_t session = pvid_get_u32(&payload[PVID_CONFIGURE_SESSION]);
    if ((session == stream.session) && running()) {
        return; /* sent again because the answer was lost */
    }
    answer_raw();
    stream.session = session;
    stream.source = payload[PVID_CONFIGURE_SOURCE];
    stream.hash_every = pvid_get_u16(&payload[PVID_CONFIGURE_HASH_EVERY]);
    stream.estimate_every = pvid_get_u16(&payload[PVID_CONFIGURE_ESTIMATE_EVERY]);
    stream.ticks = pvid_get_u32(&payload[IDENTIFIER_CONFIGURE_FIRST_TICK]);
    stream.tick_high = pvid_get_u16(&payload[IDENTIFIER_CONFIGURE_FIRST_TICK + 4u]);
    stream.hash = PVID_FNV_START;
    stream.sample_hash = PVID_FNV_START;
    stream.reason = PVID_WARMING_UP;
    stream.verdict = PVID_WARMING_UP;
    stream.repeated = 0;
    stream.skipped = 0;
    if (identifier_arithmetic_faults() != 0u) {
        stream.code = PVID_CODE_ARITHMETIC;
    } else if (payload[PVID_CONFIGURE_FORM] != STREAM_FORM) {
        stream.code = PVID_CODE_REFUSED_FORM;
    } else if (pvid_get_u32(&payload[PVID_CONFIGURE_SETTINGS]) != STREAM_SETTINGS) {
        stream.code = PVID_CODE_REFUSED_SETTINGS;
    } else if (stream.source > PVID_SOURCE_SENSOR_PACED) {
        stream.code = PVID_CODE_REFUSED_SOURCE;
    } else {
        start_over(payload);
    }
}

/* The other core's Configure. */
static void refuse(const uint8_t payload[])
{
    stream.session = pvid_get_u32(&payload[PVID_CONFIGURE_SESSION]);
    stream.code = PVID_CODE_REFUSED_FORM;
}

/* Takes a frame of samples into work if it holds the next one. */
static void take(const pvid_link_frame *frame)
{
    const uint32_t n = (uint32_t)(frame->length / SAMPLE_BYTES);
    const uint32_t known = stream.ticks - frame->tick; /* of its samples; it is ahead where that wraps */
    if (!running() || sampling()) {
        answer_status();
    } else if (known >= 0x80000000u) {
        stream.skipped++;
        answer_status();
    } else if (known >= n) {
        stream.repeated += n;
        answer_credit();
    } else {
        stream.repeated += known;
        stream.samples = *frame;
        stream.taken = known;
        stream.count = n;
    }
}

static void obey(const pvid_link_frame *frame)
{
    if ((frame->type == IDENTIFIER_CONFIGURE) && (frame->length == IDENTIFIER_CONFIGURE_BYTES)) {
        configure(frame->payload);
        answer_status();
        answer_credit();
    } else if (((frame->type == PVID_CONFIGURE) || (frame->type == PVID_CONFIGURE_Q31)) &&
               (frame->length >= PVID_CONFIGURE_DIVIDER)) {
        refuse(frame->payload);
        answer_status();
    } else if ((frame->type == IDENTIFIER_SAMPLE) && ((frame->length % SAMPLE_BYTES) == 0u)) {
        take(frame);
    } else if (frame->type == PVID_CREDIT) {
        stream.due = DUE_ALL;
        answer_raw();
        if (running()) {
            answer_estimate();
        }
        answer_credit();
    } else {
        answer_status();
    }
}

/* Takes bytes in up to the end of a frame; returns whether there was one. */
static bool listen(void)
{
    static uint8_t bytes[CHUNK];
    static size_t at;
    static size_t n;
    pvid_link_frame frame;
    if (at == n) {
        at = 0;
        n = pvid_receiver_take(bytes, sizeof bytes);
    }
    const bool any = at < n;
    bool whole = false;
    size_t next = at;
    for (const size_t end = n; (next < end) && !whole; next++) {
        whole = pvid_link_decode(&stream.decoder, bytes[next], &frame);
    }
    at = next;
    if (whole) {
        obey(&frame);
    }
    return any;
}

int main(void)
{
    pvid_port_init();
    pvid_receiver_init();
    pvid_link_decoder_init(&stream.decoder);
    stream.due = DUE_HELLO | DUE_SCHEMA;
    for (;;) {
        answers_pump(&stream.out);
        announce();
        const bool room = answers_fit(&stream.out, ANSWER_ROOM); /* else the PC does not read: neither do we */
        if (stream.count > 0u) {
            if (room) {
                step_sent();
            }
            continue;
        }
        const bool heard = room && listen();
        if (sampling()) {
            if (sample_due(room)) {
                step_field();
            }
        } else if (!heard && answers_fit(&stream.out, ANSWERS_BYTES)) {
            pvid_receiver_rest(); /* nothing is to be done or said */
        } else {
            /* on with it */
        }
    }
}
