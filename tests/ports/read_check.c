/* Estimates read while others are published, by an interrupt on a board: SysTick comes at every instruction of a put
 * and of a read, sooner or later. First the main loop publishes and the interrupt reads, then the other way round.
 * Beside it the same with a plain copy of the struct.
 *
 * The words of an estimate all hold its number, so that a torn one shows. */
#include <string.h>

#include "port.h"
#include "pvid/publication_q31.h"
#include "report.h"

#define SYSTICK_REGISTER(offset) (*(volatile uint32_t *)(uintptr_t)(0xE000E010u + (offset)))
#define CONTROL SYSTICK_REGISTER(0x0u)
#define RELOAD SYSTICK_REGISTER(0x4u)
#define VALUE SYSTICK_REGISTER(0x8u)
#define ENABLE_WITH_INTERRUPT 0x7u
#define DISABLE 0u
#define SHORTEST 150u /* counts between interrupts: some dozen instructions */
#define SPREAD 2503u  /* a prime, so that an interrupt comes everywhere */

#define INTERRUPTS 20000u
#define WORDS (sizeof(pvid_estimate_q31) / sizeof(uint32_t))

static pvid_publication_q31 shared;
static volatile pvid_estimate_q31 plain; /* words in the order of the source, no more */

static volatile bool interrupt_reads;
static volatile uint32_t interrupts;
static volatile uint32_t number;

typedef struct {
    uint32_t reads;
    uint32_t odd;
    uint32_t again;
    uint32_t missed;
    uint32_t torn;
    uint32_t plain_torn;
} tally;
static tally in_interrupt;
static tally in_loop;

static void put(void)
{
    pvid_estimate_q31 estimate;
    uint32_t words[WORDS];
    number++;
    for (size_t i = 0; i < WORDS; i++) {
        words[i] = number;
    }
    memcpy(&estimate, words, sizeof estimate);
    plain = estimate;
    pvid_publication_put_q31(&shared, &estimate);
}

static bool is_whole(const pvid_estimate_q31 *estimate)
{
    uint32_t words[WORDS];
    memcpy(words, estimate, sizeof words);
    bool whole = true;
    for (size_t i = 1; i < WORDS; i++) {
        whole = whole && (words[i] == words[0]);
    }
    return whole;
}

static void read_both(tally *seen)
{
    pvid_estimate_q31 estimate = plain;
    seen->plain_torn += is_whole(&estimate) ? 0u : 1u;
    const uint32_t before = interrupts;
    const uint32_t odd = ((volatile pvid_publication_mark *)&shared.mark)->version % 2u;
    uint32_t count;
    seen->reads++;
    seen->odd += odd;
    if (pvid_publication_read_q31(&shared, &estimate, &count)) {
        uint32_t first;
        memcpy(&first, &estimate, sizeof first);
        seen->torn += (is_whole(&estimate) && (first == count)) ? 0u : 1u;
    } else {
        seen->missed++;
    }
    seen->again += (interrupts != before) ? 1u : 0u;
}

void pvid_systick_interrupt(void);

void pvid_systick_interrupt(void)
{
    CONTROL = DISABLE;
    interrupts++;
    RELOAD = SHORTEST + ((interrupts * 389u) % SPREAD);
    if (interrupt_reads) {
        read_both(&in_interrupt);
    } else {
        put();
    }
    VALUE = 0u; /* counts from here */
    CONTROL = (interrupts < INTERRUPTS) ? ENABLE_WITH_INTERRUPT : DISABLE;
}

static void let_interrupts_come(bool reads)
{
    interrupt_reads = reads;
    interrupts = 0u;
    RELOAD = SHORTEST;
    VALUE = 0u;
    CONTROL = ENABLE_WITH_INTERRUPT;
    while (interrupts < INTERRUPTS) {
        if (reads) {
            put();
        } else {
            read_both(&in_loop);
        }
    }
}

int main(void)
{
    pvid_port_init();
    put();
    let_interrupts_come(true);
    let_interrupts_come(false);
    report_number("interrupt_reads", in_interrupt.reads);
    report_number("interrupt_odd", in_interrupt.odd);
    report_number("interrupt_missed", in_interrupt.missed);
    report_number("interrupt_torn", in_interrupt.torn);
    report_number("interrupt_plain_torn", in_interrupt.plain_torn);
    report_number("loop_reads", in_loop.reads);
    report_number("loop_again", in_loop.again);
    report_number("loop_missed", in_loop.missed);
    report_number("loop_torn", in_loop.torn);
    report_number("loop_plain_torn", in_loop.plain_torn);
    return 0;
}
