/* weak_front_q31: the weights of a design, at every decimation and number of taps of `geometry`, with the ring's head
 * in every place and any samples within full scale in the ring: F and U stay within what the rest of the design counts
 * on, and the job is over when the next one begins. */
#include "prove.h"

#include "weak_design.h"
#include "weak/front_q31.h"

static const struct {
    uint16_t taps;
    uint16_t decimation;
} geometry[] = {{71, 8}, {5, 1}, {7, 2}, {9, 3}};

static pvid_weak_front_q31 front;
static int64_t f_max;

static void any_sample(const pvid_weak_design_q31 *design)
{
    int32_t f;
    int64_t u;
    const int32_t phi = any_i32(-design->phi_max, design->phi_max);
    const int32_t y = any_i32(-design->y_max, design->y_max);
    if (pvid_weak_front_step_q31(&front, design, phi, y, &f, &u)) {
        /*@ assert -f_max <= f <= f_max; */
        /*@ assert -0x4000000000000000 <= u <= 0x4000000000000000; */
    }
}

static void any_block(const pvid_weak_design_q31 *design, uint16_t head, uint16_t wait)
{
    front.job.head = head;
    front.job.wait = wait;
    front.job.pair = front.job.half;
    for (uint16_t tick = 0; tick < design->decimation; tick++) {
        any_sample(design);
    }
    /*@ assert front.job.wait == 1 && front.job.pair == front.job.half; */
}

void main(void)
{
    for (size_t g = 0; g < sizeof geometry / sizeof geometry[0]; g++) {
        pvid_weak_design_q31 design = weak_unit_design;
        design.taps = geometry[g].taps;
        design.decimation = geometry[g].decimation;
        f_max = largest_f(&design);
        pvid_weak_front_init_q31(&front, &design);
        /*@ assert front.job.pair == front.job.half && front.job.wait >= 1; */
        for (size_t i = 0; i < front.job.length; i++) {
            front.ring[i][0] = any_i32(-design.phi_max, design.phi_max);
            front.ring[i][1] = any_i32(-design.y_max, design.y_max);
        }
        for (uint16_t head = 0; head < front.job.length; head++) {
            any_block(&design, head, 1);
        }
        pvid_weak_front_reset_q31(&front);
        const uint16_t first = front.job.wait;
        for (uint16_t before = 1; before < first; before++) { /* until the ring is full */
            any_sample(&design);
        }
        /*@ assert front.job.wait == 1 && front.job.pair == front.job.half; */
    }
}
