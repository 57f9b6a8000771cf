/* weak_front_q31.c with the compensators of the pendulum's design (weak_design_q31.h, which tools/prove.py makes):
 * any counts within full scale, block after block from a restart on, with each place of the line's head. */
#include "prove.h"

#include "weak/weak_front_q31.c" /* one unit: its inline functions are these */

#include "weak_design_q31.h"

/* A conversion modulo 2^32, as of every compiler for the targets. */
/*@ requires -0x40000000 <= offset <= 0x40000000;
    assigns \result \from reading, offset;
    ensures -0x80000000 <= reading - offset <= 0x7FFFFFFF ==> \result == reading - offset; */
static inline int32_t pvid_weak_count_q31(int32_t reading, int32_t offset);

static const int32_t offset[PVID_MAX_SAMPLES] = {0};
static pvid_weak_front_q31 front;

/* D ticks, and the jets if the line is full. Every output is within 28 bits. */
static bool any_block(int32_t jet[PVID_MAX_INPUTS])
{
    const pvid_weak_design_q31 *design = &weak_design_q31;
    for (size_t tick = 0; tick < design->decimation; tick++) {
        int32_t reading[PVID_MAX_SAMPLES] = {0};
        for (size_t i = 0; i < design->model->samples; i++) {
            reading[i] = any_i32(-design->full_scale[i], design->full_scale[i]);
        }
        (void)pvid_weak_front_add_q31(&front, design, reading);
    }
    const size_t signals = design->model->signals;
    const int32_t *output = &front.line[3u * signals];
    const bool full = pvid_weak_front_step_q31(&front, design, jet);
    for (size_t i = 0; i < (((2u * front.half) + 1u) * signals); i++) {
        /*@ assert -0x10000000 <= *(output + i) <= 0x10000000; */
    }
    return full;
}

/* Beyond full scale nothing is added. */
static void too_much(void)
{
    const pvid_weak_design_q31 *design = &weak_design_q31;
    int32_t reading[PVID_MAX_SAMPLES] = {0};
    reading[0] = any_i32(design->full_scale[0] + 1, INT32_MAX);
    const bool more = pvid_weak_front_add_q31(&front, design, reading);
    /*@ assert more == 0; */
    reading[0] = any_i32(INT32_MIN, -design->full_scale[0] - 1);
    const bool less = pvid_weak_front_add_q31(&front, design, reading);
    /*@ assert less == 0; */
}

void main(void)
{
    int32_t jet[PVID_MAX_INPUTS];
    pvid_weak_front_init_q31(&front, &weak_design_q31, offset);
    too_much();
    const size_t length = (2u * (size_t)front.half) + 1u;
    for (size_t block = 0; block < (3u * length) + 2u; block++) {
        (void)any_block(jet);
    }
    const bool full = any_block(jet);
    /*@ assert full == 1; */
}
