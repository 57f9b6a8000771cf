/* The schedule of the weak form, for every size that the configuration allows. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>

#include "pvid/config.h"
#include "weak/schedule.h"

/* A block has ticks enough: two windows of slices and the stages' own. */
static void every_block_has_room(void **state)
{
    (void)state;
    for (uint32_t decimation = 3; decimation <= PVID_MAX_DECIMATION; decimation++) {
        for (uint32_t functions = 4; functions <= PVID_MAX_FUNCTIONS; functions++) {
            const uint32_t pairs_per_tick = pvid_weak_functions_per_tick(decimation, functions);
            const uint32_t ticks = decimation - pvid_weak_free_ticks(decimation, functions);
            assert_true((pairs_per_tick >= 1u) && (pairs_per_tick <= functions));
            assert_true((ticks / 2u) * pairs_per_tick >= functions);       /* a window takes a sample in */
            assert_true(((ticks / 2u) - 1u) * pairs_per_tick < functions); /* and wastes no tick */
            assert_true(ticks <= decimation - (decimation / 2u));          /* in the second half */
        }
    }
}

/* Without a tick to spare, everything is done in the one there is. */
static void low_decimation_does_all_at_once(void **state)
{
    (void)state;
    for (uint32_t decimation = 1; decimation <= 2u; decimation++) {
        assert_int_equal(pvid_weak_functions_per_tick(decimation, 12), 12);
        assert_int_equal(pvid_weak_free_ticks(decimation, 12), 1);
    }
}

static void stages_go_together_only_where_they_must(void **state)
{
    (void)state;
    /* D = 8, K = 12: windows in 4 of 8 ticks; W = 9: a hop of 4, so 16 ticks for a window's stages */
    assert_int_equal(pvid_weak_stages_per_tick(16, 9, 8, 12), 1);
    assert_int_equal(pvid_weak_stages_per_tick(17, 9, 8, 12), 2);
    assert_int_equal(pvid_weak_stages_per_tick(16 * PVID_STAGES_PER_TICK_MAX, 9, 8, 12), PVID_STAGES_PER_TICK_MAX);
    assert_int_equal(pvid_weak_stages_per_tick((16 * PVID_STAGES_PER_TICK_MAX) + 1, 9, 8, 12), 0);
}

static void odd_sizes_within_bounds(void **state)
{
    (void)state;
    assert_true(pvid_is_odd_within(5, 5, 9) && pvid_is_odd_within(9, 5, 9));
    assert_false(pvid_is_odd_within(3, 5, 9) || pvid_is_odd_within(11, 5, 9) || pvid_is_odd_within(6, 5, 9));
}

/* Ticks of a job and the pairs it visits, for a ring that turns many times: each pair once, in order, at the places
 * of the samples that stand as far from the centre. */
static void a_job_visits_every_pair_at_its_place(void **state)
{
    (void)state;
    pvid_weak_job job;
    uint32_t sample_at[32] = {0};
    pvid_weak_job_init(&job, 9, 5);
    assert_int_equal(job.length, 13);
    assert_int_equal(pvid_weak_job_ticks(&job), 2); /* four pairs in half of five ticks */
    uint32_t begun = 0;
    for (uint32_t tick = 0; tick < 200u; tick++) {
        sample_at[job.head] = tick;
        if (pvid_weak_job_begins(&job)) {
            assert_int_equal(tick, 8u + (5u * begun));
            assert_int_equal(sample_at[job.newer], tick - 4u); /* the centre of nine */
            begun++;
        }
        size_t newer = job.newer;
        size_t older = job.older;
        const size_t last = pvid_weak_job_end(&job);
        size_t i = job.pair;
        for (uint32_t runs = 0; i < last; runs++) {
            assert_true(runs < PVID_WEAK_JOB_RUNS);
            const size_t run = pvid_weak_job_outwards(&job, last - i, &newer, &older);
            const uint32_t centre = 4u + (5u * (begun - 1u));
            for (size_t k = 0; k < run; k++) {
                i++;
                assert_int_equal(sample_at[newer + k], centre + i);
                assert_int_equal(sample_at[older - k], centre - i);
            }
            newer += run - 1u;
            older -= run - 1u;
        }
        job.newer = (uint16_t)newer;
        job.older = (uint16_t)older;
        job.pair = (uint16_t)last;
    }
    assert_int_equal(begun, 39);
    assert_int_equal(job.pair, job.half);
}

/* A job that is done at once, in a ring as short as can be, is cut in two at an end of the ring, unless it begins in
 * the middle or at an end. */
static void a_job_crosses_an_end_of_the_ring_once(void **state)
{
    (void)state;
    pvid_weak_job job;
    pvid_weak_job_init(&job, 9, 1);
    assert_int_equal(job.length, 9);
    uint32_t crossed = 0;
    for (uint32_t tick = 0; tick < 8u + 90u; tick++) {
        if (!pvid_weak_job_begins(&job)) {
            continue;
        }
        size_t newer = job.newer;
        size_t older = job.older;
        uint32_t runs = 0;
        for (size_t i = 0; i < job.half; runs++) {
            const size_t run = pvid_weak_job_outwards(&job, job.half - i, &newer, &older);
            i += run;
            newer += run - 1u;
            older -= run - 1u;
        }
        assert_in_range(runs, 1, PVID_WEAK_JOB_RUNS);
        crossed += runs - 1u;
    }
    assert_int_equal(crossed, 60);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_block_has_room),
        cmocka_unit_test(low_decimation_does_all_at_once),
        cmocka_unit_test(stages_go_together_only_where_they_must),
        cmocka_unit_test(odd_sizes_within_bounds),
        cmocka_unit_test(a_job_visits_every_pair_at_its_place),
        cmocka_unit_test(a_job_crosses_an_end_of_the_ring_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
