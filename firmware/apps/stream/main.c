/* The identifier behind a serial link: the PC configures it and sends samples, the board steps and answers with
 * credits, running hashes, estimates and its status. Frames: link.h and schema.h.
 *
 * No sample is lost: samples are numbered, only the next one is taken, and each credit says which that is and how
 * many may be under way. What a line swallows or spoils is sent again; what comes twice is counted and left out.
 * Every answer carries the session number of the configuration, so that a board that has restarted is noticed.
 *
 * stream_rig.h (pvid.stream_image makes it) holds the settings and tables; Configure brings the start and the law.
 * The PC's Configure is refused when it was made for other settings. The host runs the same program on a
 * pseudo-terminal (ports/host).
 */
#include <string.h>

#include "answers.h"
#include "link.h"
#include "pvid/little_endian.h"
#include "port.h"
#include "pvid/pvid.h"
#include "stream_rig.h"

#if STREAM_WEAK
typedef pvid_weak_f32 identifier_f32;
typedef pvid_weak_config_f32 config_f32;
#define INIT pvid_weak_init_f32
#define STEP pvid_weak_step_f32
#define FORM PVID_FORM_WEAK
#else
typedef pvid_strong_f32 identifier_f32;
typedef pvid_strong_config_f32 config_f32;
#define INIT pvid_strong_init_f32
#define STEP pvid_strong_step_f32
#define FORM PVID_FORM_STRONG
#endif

#define WINDOW 256u       /* samples that may be under way */
#define SAMPLE_PAIR 8u    /* bytes of phi and y */
#define LINK_MAX_P 6u     /* places for parameters in a frame */
#define ANSWER_ROOM 1280u /* all that one sample or one question may be answered with */
#define CHUNK 64u

#if PVID_MAX_P > 6
#error "the frames hold six parameters"
#endif

static struct {
    answers out;
    pvid_link_decoder decoder;
    identifier_f32 identifier;
    uint32_t session;
    uint8_t code;
    pvid_status core;
    uint16_t hash_every;
    uint16_t estimate_every;
    uint32_t ticks; /* samples worked off: the number of the next one */
    uint32_t hash;
    pvid_reason reason;
    uint32_t repeated;
    uint32_t skipped;
    pvid_link_frame samples; /* the frame in work */
    uint32_t taken;          /* of its samples */
    uint32_t count;          /* of its samples; 0: none is in work */
} stream;

/* ---- answers */

static void answer_hello(void)
{
    static const char board[] = PVID_BOARD_NAME;
    static const char schema[] = PVID_LINK_SCHEMA_TEXT;
    uint8_t payload[PVID_HELLO_BYTES];
    memset(payload, 0, sizeof payload);
    payload[PVID_HELLO_FORM] = FORM;
    payload[PVID_HELLO_N_P] = STREAM_N_P;
    pvid_put_u16(&payload[PVID_HELLO_WINDOW], WINDOW);
    pvid_put_u32(&payload[PVID_HELLO_SETTINGS], STREAM_SETTINGS);
    pvid_put_u32(&payload[PVID_HELLO_SESSION], stream.session);
    for (size_t i = 0; (i < (sizeof board - 1u)) && (i < (PVID_HELLO_BYTES - PVID_HELLO_BOARD)); i++) {
        payload[PVID_HELLO_BOARD + i] = (uint8_t)board[i];
    }
    answers_put(&stream.out, PVID_HELLO, stream.ticks, payload, sizeof payload);
    answers_put(&stream.out, PVID_SCHEMA, stream.ticks, (const uint8_t *)schema, sizeof schema - 1u);
}

static void answer_status(void)
{
    const pvid_counters *counters = &stream.identifier.estimator.counters;
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
    answers_put(&stream.out, PVID_STATUS, stream.ticks, payload, sizeof payload);
}

static void answer_credit(void)
{
    uint8_t payload[PVID_CREDIT_BYTES];
    pvid_put_u32(&payload[PVID_CREDIT_SESSION], stream.session);
    pvid_put_u32(&payload[PVID_CREDIT_ROOM], WINDOW);
    pvid_put_u32(&payload[PVID_CREDIT_HASH], stream.hash);
    payload[PVID_CREDIT_REASON] = (uint8_t)stream.reason;
    answers_put(&stream.out, PVID_CREDIT, stream.ticks, payload, sizeof payload);
}

static void answer_hash(void)
{
    uint8_t payload[PVID_HASH_BYTES];
    pvid_put_u32(&payload[PVID_HASH_SESSION], stream.session);
    pvid_put_u32(&payload[PVID_HASH_HASH], stream.hash);
    answers_put(&stream.out, PVID_HASH, stream.ticks, payload, sizeof payload);
}

static void answer_estimate(void)
{
    pvid_estimate_f32 estimate;
    uint8_t payload[PVID_ESTIMATE_BYTES];
    memset(payload, 0, sizeof payload);
    pvid_estimator_assess_f32(&stream.identifier.estimator, &estimate);
    pvid_put_u32(&payload[PVID_ESTIMATE_SESSION], stream.session);
    pvid_put_u32(&payload[PVID_ESTIMATE_UPDATES], stream.identifier.estimator.counters.updates);
    size_t at = PVID_ESTIMATE_COVARIANCE;
    for (size_t i = 0; i < LINK_MAX_P; i++) {
        for (size_t j = i; j < LINK_MAX_P; j++) {
            if (j < STREAM_N_P) {
                pvid_put_f32(&payload[at], estimate.covariance[i][j]);
            }
            at += 4u;
        }
        if (i < STREAM_N_P) {
            pvid_put_f32(&payload[PVID_ESTIMATE_P + (4u * i)], estimate.p[i]);
        }
    }
    pvid_put_f32(&payload[PVID_ESTIMATE_KAPPA], estimate.kappa);
    pvid_put_f32(&payload[PVID_ESTIMATE_RESIDUAL_SD], estimate.residual_sd);
    pvid_put_f32(&payload[PVID_ESTIMATE_WEIGHT], estimate.weight);
    payload[PVID_ESTIMATE_REASON] = (uint8_t)stream.reason;
    answers_put(&stream.out, PVID_ESTIMATE, stream.ticks, payload, sizeof payload);
}

/* ---- what comes from the PC */

static void get_floats(float to[], const uint8_t from[])
{
    for (size_t i = 0; i < STREAM_N_P; i++) {
        to[i] = pvid_get_f32(&from[4u * i]);
    }
}

static void start_over(const uint8_t payload[PVID_CONFIGURE_BYTES])
{
    config_f32 config = stream_config;
    pvid_estimator_config_f32 *estimator = &config.estimator;
    get_floats(estimator->start, &payload[PVID_CONFIGURE_START]);
    get_floats(estimator->start_sd, &payload[PVID_CONFIGURE_START_SD]);
    get_floats(estimator->lower, &payload[PVID_CONFIGURE_LOWER]);
    get_floats(estimator->upper, &payload[PVID_CONFIGURE_UPPER]);
    estimator->row_sd = pvid_get_f32(&payload[PVID_CONFIGURE_ROW_SD]);
    estimator->forgetting_s = pvid_get_f32(&payload[PVID_CONFIGURE_FORGETTING_S]);
    estimator->feedback_hz = pvid_get_f32(&payload[PVID_CONFIGURE_FEEDBACK_HZ]);
    estimator->law =
        (payload[PVID_CONFIGURE_LAW] == (uint8_t)PVID_LAW_STATIONARY) ? PVID_LAW_STATIONARY : PVID_LAW_PSEUDOVELOCITY;
    estimator->divider = pvid_get_u16(&payload[PVID_CONFIGURE_DIVIDER]);
    stream.core = INIT(&stream.identifier, &config);
    stream.code = (stream.core == PVID_OK) ? PVID_CODE_RUNNING : PVID_CODE_REFUSED_BY_CORE;
}

static void configure(const uint8_t payload[PVID_CONFIGURE_BYTES])
{
    const uint32_t session = pvid_get_u32(&payload[PVID_CONFIGURE_SESSION]);
    if ((session == stream.session) && (stream.code == PVID_CODE_RUNNING)) {
        return; /* sent again because the answer was lost */
    }
    stream.session = session;
    stream.hash_every = pvid_get_u16(&payload[PVID_CONFIGURE_HASH_EVERY]);
    stream.estimate_every = pvid_get_u16(&payload[PVID_CONFIGURE_ESTIMATE_EVERY]);
    stream.ticks = 0;
    stream.hash = PVID_FNV_START;
    stream.reason = PVID_WARMING_UP;
    stream.repeated = 0;
    stream.skipped = 0;
    if (pvid_arithmetic_faults_f32() != 0u) {
        stream.code = PVID_CODE_ARITHMETIC;
    } else if (payload[PVID_CONFIGURE_FORM] != FORM) {
        stream.code = PVID_CODE_REFUSED_FORM;
    } else if (pvid_get_u32(&payload[PVID_CONFIGURE_SETTINGS]) != STREAM_SETTINGS) {
        stream.code = PVID_CODE_REFUSED_SETTINGS;
    } else {
        start_over(payload);
    }
}

/* Takes a frame of samples into work if it holds the next one. */
static void take(const pvid_link_frame *frame)
{
    const uint32_t n = (uint32_t)(frame->length / SAMPLE_PAIR);
    const uint32_t known = stream.ticks - frame->tick;
    if (stream.code != PVID_CODE_RUNNING) {
        answer_status();
    } else if (frame->tick > stream.ticks) {
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
    if ((frame->type == PVID_CONFIGURE) && (frame->length == PVID_CONFIGURE_BYTES)) {
        configure(frame->payload);
        answer_status();
        answer_credit();
    } else if ((frame->type == PVID_SAMPLE) && ((frame->length % SAMPLE_PAIR) == 0u)) {
        take(frame);
    } else if (frame->type == PVID_CREDIT) {
        answer_hello();
        answer_status();
        if (stream.code == PVID_CODE_RUNNING) {
            answer_estimate();
        }
        answer_credit();
    } else {
        answer_status();
    }
}

static void step(void)
{
    const uint8_t *pair = &stream.samples.payload[SAMPLE_PAIR * stream.taken];
    stream.reason = STEP(&stream.identifier, pvid_get_f32(pair), pvid_get_f32(&pair[4]));
    stream.hash = pvid_fnv_estimator_f32(stream.hash, &stream.identifier.estimator, stream.reason);
    stream.ticks++;
    if ((stream.hash_every != 0u) && ((stream.ticks % stream.hash_every) == 0u)) {
        answer_hash();
    }
    if ((stream.estimate_every != 0u) && ((stream.ticks % stream.estimate_every) == 0u)) {
        answer_estimate();
    }
    stream.taken++;
    if (stream.taken == stream.count) {
        stream.count = 0;
        answer_credit();
    }
}

int main(void)
{
    uint8_t bytes[CHUNK];
    size_t at = 0;
    size_t n = 0;
    pvid_link_frame frame;
    pvid_port_init();
    pvid_link_decoder_init(&stream.decoder);
    answer_hello();
    for (;;) {
        answers_pump(&stream.out);
        if (!answers_fit(&stream.out, ANSWER_ROOM)) {
            continue; /* the PC does not read: neither do we */
        }
        if (stream.count > 0u) {
            step();
        } else if (at == n) {
            at = 0;
            n = pvid_port_receive(bytes, sizeof bytes);
        } else if (pvid_link_decode(&stream.decoder, bytes[at++], &frame)) {
            obey(&frame);
        }
    }
}
