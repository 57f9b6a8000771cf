/* One thread publishes or steps, another reads; to be built with -fsanitize=thread, which reports every data race.
 *
 * Prints "puts N reads M torn T backwards B missed G" of words that count, in both cores' estimates, then
 * "published N reads M torn T" of the weak form. Exit code 0 iff nothing was torn. With
 * -DPLAIN_COPY the words go through a plain copy of the struct: what a user would do without publication.h. */
#include <pthread.h>
#include <stdio.h>
#include <string.h>

#include "../unit/first_order.h"
#include "pvid/pvid.h"
#include "pvid/pvid_q31.h"

#define PUTS 100000u
#define WORDS (sizeof(pvid_estimate_f32) / sizeof(float))
#define WORDS_Q31 (sizeof(pvid_estimate_q31) / sizeof(uint32_t))
#define MOST_PUBLISHED 512u

static int ended; /* by __atomic accesses alone */

static int has_ended(void)
{
    return __atomic_load_n(&ended, __ATOMIC_ACQUIRE);
}

static void set_ended(int value)
{
    __atomic_store_n(&ended, value, __ATOMIC_RELEASE);
}

/* ---- words that count ---- */

static pvid_publication_f32 shared;
static pvid_publication_q31 shared_q31;

static void put(uint32_t number)
{
    pvid_estimate_f32 estimate;
    pvid_estimate_q31 estimate_q31;
    float words[WORDS];
    uint32_t words_q31[WORDS_Q31];
    for (size_t i = 0; i < WORDS; i++) {
        words[i] = (float)number;
    }
    for (size_t i = 0; i < WORDS_Q31; i++) {
        words_q31[i] = number;
    }
    memcpy(&estimate, words, sizeof estimate);
    memcpy(&estimate_q31, words_q31, sizeof estimate_q31);
#ifdef PLAIN_COPY
    shared.estimate = estimate;
    shared.mark.number[0]++;
    shared_q31.estimate = estimate_q31;
    shared_q31.mark.number[0]++;
#else
    pvid_publication_put_f32(&shared, &estimate);
    pvid_publication_put_q31(&shared_q31, &estimate_q31);
#endif
}

static int get(pvid_estimate_f32 *estimate, pvid_estimate_q31 *estimate_q31, uint32_t *number, uint32_t *number_q31)
{
#ifdef PLAIN_COPY
    *estimate = shared.estimate;
    *number = shared.mark.number[0];
    *estimate_q31 = shared_q31.estimate;
    *number_q31 = shared_q31.mark.number[0];
    return 1;
#else
    return pvid_publication_read_f32(&shared, estimate, number) &&
           pvid_publication_read_q31(&shared_q31, estimate_q31, number_q31);
#endif
}

typedef struct {
    unsigned long reads;
    unsigned long torn;
    unsigned long backwards;
    unsigned long missed;
} tally;

static void *read_words(void *argument)
{
    tally *seen = argument;
    uint32_t before = 0;
    do {
        pvid_estimate_f32 estimate;
        pvid_estimate_q31 estimate_q31;
        uint32_t number;
        uint32_t number_q31;
        float words[WORDS];
        uint32_t words_q31[WORDS_Q31];
        seen->reads++;
        if (!get(&estimate, &estimate_q31, &number, &number_q31)) {
            seen->missed++;
            continue;
        }
        memcpy(words, &estimate, sizeof words);
        memcpy(words_q31, &estimate_q31, sizeof words_q31);
        int whole = 1;
        for (size_t i = 0; i < WORDS; i++) {
            whole = whole && (words[i] >= (float)number) && (words[i] <= (float)number);
        }
        for (size_t i = 0; i < WORDS_Q31; i++) {
            whole = whole && (words_q31[i] == number_q31);
        }
        seen->torn += whole ? 0u : 1u;
        seen->backwards += (number < before) ? 1u : 0u;
        before = number;
    } while (!has_ended());
    return NULL;
}

static tally share_words(void)
{
    tally seen = {0, 0, 0, 0};
    pthread_t reader;
    set_ended(0);
    pthread_create(&reader, NULL, read_words, &seen);
    for (uint32_t number = 1; number <= PUTS; number++) {
        put(number);
    }
    set_ended(1);
    pthread_join(reader, NULL);
    return seen;
}

/* ---- an identifier ---- */

static pvid_weak_f32 identifier;
static pvid_estimate_f32 published[MOST_PUBLISHED]; /* by number; written by the stepping thread */

typedef struct {
    unsigned long reads;
    pvid_estimate_f32 estimate[MOST_PUBLISHED]; /* the first that was read of each number */
    unsigned char has[MOST_PUBLISHED];
    unsigned long torn; /* another one of the same number that differed, but for the standing, which goes on changing */
} readings;

static int differ(pvid_estimate_f32 one, pvid_estimate_f32 other)
{
    memset(&one.standing, 0, sizeof one.standing);
    memset(&other.standing, 0, sizeof other.standing);
    return memcmp(&one, &other, sizeof one) != 0;
}

static void *read_identifier(void *argument)
{
    readings *seen = argument;
    do {
        pvid_estimate_f32 estimate;
        uint32_t number;
        if (pvid_weak_read_f32(&identifier, &estimate, &number) && (number > 0u) && (number < MOST_PUBLISHED)) {
            seen->reads++;
            if (seen->has[number] == 0u) {
                seen->estimate[number] = estimate;
                seen->has[number] = 1u;
            }
            seen->torn += differ(estimate, seen->estimate[number]) ? 1u : 0u;
        }
    } while (!has_ended());
    return NULL;
}

static unsigned long step_identifier(readings *seen)
{
    const pvid_weak_design_f32 design = design_of(&mechanism);
    const pvid_weak_config_f32 config = config_of(&design);
    if (pvid_weak_init_f32(&identifier, &config) != PVID_OK) {
        return 0;
    }
    pthread_t reader;
    set_ended(0);
    pthread_create(&reader, NULL, read_identifier, seen);
    first_order rig = {.generator = 1u};
    unsigned long number = 0;
    for (int tick = 0; tick < 500 * HOP; tick++) {
        float sample[2];
        next_sample(&rig, sample);
        const pvid_reason reason = pvid_weak_step_f32(&identifier, sample);
        if ((reason == PVID_UPDATED) || (reason == PVID_MISFIT)) {
            number++;
            published[number % MOST_PUBLISHED] = *pvid_weak_estimate_f32(&identifier);
        }
    }
    set_ended(1);
    pthread_join(reader, NULL);
    for (size_t i = 0; i < MOST_PUBLISHED; i++) {
        if ((seen->has[i] != 0u) && differ(seen->estimate[i], published[i])) {
            seen->torn++;
        }
    }
    return number;
}

int main(void)
{
    const tally words = share_words();
    printf("puts %lu reads %lu torn %lu backwards %lu missed %lu\n", (unsigned long)PUTS, words.reads, words.torn,
           words.backwards, words.missed);
    static readings seen;
    const unsigned long number = step_identifier(&seen);
    printf("published %lu reads %lu torn %lu\n", number, seen.reads, seen.torn);
    return ((words.torn == 0u) && (words.backwards == 0u) && (seen.torn == 0u)) ? 0 : 1;
}
