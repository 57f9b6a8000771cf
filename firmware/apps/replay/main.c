/* Runs the identifier on the samples in the image and reports as lines of text: the running hash (fnv.h) during
 * the run and at the end, the cost of a tick, and the size of stack and state. It needs no link: run it first on a
 * new board. `pvid sizes` and the tests generate replay_run.h: settings, tables and samples in counts of the
 * sensors.
 *
 * Exit codes: 0 done, 2 the core refused the settings, 3 float arithmetic differs from the promised one.
 */
#include "port.h"
#include "pvid/little_endian.h"
#include "replay_run.h"
#include "report.h"

#define EXIT_REFUSED 2
#define EXIT_ARITHMETIC 3

#if defined(__AVR__)
#include <avr/pgmspace.h>
#define COUNT(tick, channel)                                                                                           \
    ((REPLAY_COUNT)((sizeof(REPLAY_COUNT) == 2u) ? pgm_read_word(&replay_samples[tick][channel])                       \
                                                 : pgm_read_dword(&replay_samples[tick][channel])))
#else
#define COUNT(tick, channel) (replay_samples[tick][channel])
#endif

/* Samples are given one by one, by a step of two arguments, or in blocks of REPLAY_BLOCK. */
#if !defined(REPLAY_BLOCK)
#define REPLAY_BLOCK 1u
#define REPLAY_BLOCK_STEP(self, sample, ticks) REPLAY_STEP(self, sample)
#else
#define REPLAY_BLOCK_STEP REPLAY_STEP
#endif

static REPLAY_TYPE identifier;

#if defined(REPLAY_HAS_BITS)
/* A sample from the bits of its float. */
static REPLAY_SAMPLE sample_of(REPLAY_COUNT word, REPLAY_SAMPLE lsb)
{
    uint8_t bits[4];
    pvid_put_u32(bits, word);
    return pvid_get_f32(bits) * lsb; /* lsb 1 */
}
#else
/* A count in the identifier's unit: count times step; NaN for a missing sample. */
static REPLAY_SAMPLE sample_of(REPLAY_COUNT count, REPLAY_SAMPLE lsb)
{
#if REPLAY_IS_FLOAT
    if (count == REPLAY_MISSING) {
        static const uint8_t no_number[4] = {0x00u, 0x00u, 0xC0u, 0x7Fu};
        return pvid_get_f32(no_number);
    }
#endif
    return (REPLAY_SAMPLE)count * lsb; /* fixed point: lsb 1 */
}
#endif

typedef struct {
    uint64_t total;   /* counts of pvid_port_instructions, from REPLAY_MEASURE_FROM on */
    uint32_t ticks;   /* counted in it */
    uint32_t longest; /* of all ticks, or blocks */
} cost;

/* Counts that measuring itself takes: two readings in a row. */
static uint32_t overhead(void)
{
    const uint32_t before = pvid_port_instructions();
    return pvid_port_instructions() - before;
}

static uint32_t play(cost *whole)
{
    uint32_t hash = PVID_FNV_START;
    const uint32_t reading = overhead();
    uint32_t ticks = REPLAY_BLOCK;
    for (uint32_t tick = 0; tick < REPLAY_TICKS; tick += ticks) {
        REPLAY_SAMPLE sample[REPLAY_BLOCK * REPLAY_CHANNELS];
        ticks = ((REPLAY_TICKS - tick) < ticks) ? (REPLAY_TICKS - tick) : ticks;
        for (uint32_t i = 0; i < (ticks * REPLAY_CHANNELS); i++) {
            const uint32_t channel = i % REPLAY_CHANNELS;
            sample[i] = sample_of(COUNT(tick + (i / REPLAY_CHANNELS), channel), replay_lsb[channel]);
        }
        const uint32_t before = pvid_port_instructions();
        const pvid_reason reason = REPLAY_BLOCK_STEP(&identifier, sample, ticks);
        const uint32_t counts = pvid_port_instructions() - before - reading;
        if (tick >= REPLAY_MEASURE_FROM) {
            whole->total += counts;
            whole->ticks += ticks;
        }
        whole->longest = (counts > whole->longest) ? counts : whole->longest;
        hash = REPLAY_HASH(hash, &identifier.estimator, reason);
        if (((tick + ticks) / REPLAY_REPORT_EVERY) > (tick / REPLAY_REPORT_EVERY)) {
            report_hash_at(tick + ticks, hash);
        }
    }
    return hash;
}

int main(void)
{
    pvid_port_init();
    report_text("pvid replay on " PVID_BOARD_NAME ", " REPLAY_FORM " form\n");
    const uint32_t faults = REPLAY_FAULTS;
    report_number("arithmetic_faults", faults);
    if (faults != 0u) {
        return EXIT_ARITHMETIC;
    }
    const pvid_status status = REPLAY_INIT(&identifier, &replay_config);
    report_number("status", (uint32_t)status);
    if (status != PVID_OK) {
        return EXIT_REFUSED;
    }
    cost whole = {0, 0, 0};
    const uint32_t hash = play(&whole);
    report_number("ticks", REPLAY_TICKS);
    report_hex("hash", hash);
    report_number("measured_ticks", whole.ticks);
    report_hex("total_counts_high", (uint32_t)(whole.total >> 32));
    report_hex("total_counts_low", (uint32_t)whole.total);
    report_number("longest_counts", whole.longest);
    report_number("counts_per_1024", pvid_port_counts_per_1024());
    report_number("stack_used", (uint32_t)pvid_port_stack_used());
    report_number("stack_size", (uint32_t)pvid_port_stack_size());
    report_number("state_bytes", (uint32_t)sizeof identifier);
    report_number("estimator_bytes", (uint32_t)sizeof identifier.estimator);
    report_text("done\n");
    return 0;
}
