/* Numbers of the four rows of a block: a sum is loaded and stored once for all of them. Private to the core, inlined.
 */
#ifndef PVID_STRONG_BLOCK_F32_H
#define PVID_STRONG_BLOCK_F32_H

#define PVID_STRONG_ROWS 4u /* of a block */

typedef struct {
    float r0;
    float r1;
    float r2;
    float r3;
} pvid_four_f32;

static inline pvid_four_f32 pvid_four_times_f32(pvid_four_f32 a, pvid_four_f32 b)
{
    const pvid_four_f32 product = {a.r0 * b.r0, a.r1 * b.r1, a.r2 * b.r2, a.r3 * b.r3};
    return product;
}

/* The sum with four numbers more, the oldest first. */
static inline float pvid_four_added_f32(float sum, pvid_four_f32 x)
{
    return (((sum + x.r0) + x.r1) + x.r2) + x.r3;
}

#endif
