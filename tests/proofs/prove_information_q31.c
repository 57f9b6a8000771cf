/* information_q31: any model size, one kind of rows to five, any forgetting, any row within its limit, one group.
 *
 * The sums are arbitrary within what the end of a group leaves; a group adds as many rows of each kind as a window
 * has functions.
 * Eva then shows that no sum overflows within the group. That its end brings all of them back within their bound
 * follows from Cauchy and Schwarz, since it does so with the sums of squares: intervals cannot see that. */
#include "prove.h"

#include "contracts.h"

#define SUM_BOUND ((int64_t)1 << 60)

static pvid_information_q31 sums;
static int64_t fresh[PVID_MAX_THETA_Q31];

static void any_group(const pvid_model_q31 *model)
{
    const size_t kinds = pvid_kinds_count(model->n_kinds);
    for (size_t i = 0; i < PVID_MAX_SUMS_Q31; i++) {
        sums.sums[i] = any_i64(-SUM_BOUND, SUM_BOUND);
    }
    for (size_t i = 0; i < PVID_MAX_THETA_Q31; i++) {
        fresh[i] = any_i64(-2 * SUM_BOUND, 2 * SUM_BOUND);
    }
    sums.exponent = (uint8_t)any_u32(0, 40);
    sums.age = (uint16_t)any_u32(0, sums.block - 1u);
    for (size_t kind = 0; kind < kinds; kind++) {
        pvid_block block;
        pvid_information_block_q31(model, pvid_kind_first(model->kind_end, kind), &block);
        for (size_t row = 0; row < PVID_MAX_FUNCTIONS; row++) {
            int32_t n[PVID_MAX_THETA_Q31];
            for (size_t i = 0; i < PVID_MAX_THETA_Q31; i++) {
                n[i] = any_i32(-PVID_ROW_LIMIT_Q31, PVID_ROW_LIMIT_Q31);
            }
            pvid_information_add_q31(&sums, &block, n, any_i32(-PVID_ROW_LIMIT_Q31, PVID_ROW_LIMIT_Q31), fresh);
        }
    }
    for (size_t part = 0; part < PVID_INFORMATION_END_PARTS; part++) {
        pvid_information_end_group_q31(&sums, model, part, fresh);
    }
    const int32_t factor = any_i32(1, INT32_MAX);
    for (size_t part = 0; part < PVID_INFORMATION_END_PARTS; part++) {
        pvid_information_fade_q31(&sums, part, factor);
    }
    for (size_t i = 0; i < sums.n_theta; i++) {
        /*@ assert -0x2000000000000000 <= fresh[i] <= 0x2000000000000000; */
    }
    for (size_t i = 0; i < sums.n_sums; i++) {
        /*@ assert -0x4000000000000000 <= sums.sums[i] <= 0x4000000000000000; */
    }
}

static void any_model(const pvid_model_q31 *model)
{
    pvid_information_init_q31(&sums, model, 0, any_u32(1, 65536));
    sums.block = (uint16_t)any_u32(1, 64);
    sums.retention = any_i32(1, INT32_MAX);
    any_group(model);
}

static const uint8_t two_end[2] = {1, PVID_MAX_THETA_Q31};
static const uint8_t three_end[3] = {4, 5, PVID_MAX_THETA_Q31};
static const uint8_t many_end[5] = {2, 4, 6, 8, PVID_MAX_THETA_Q31};

void main(void)
{
    pvid_model_q31 model = {.n_theta = PVID_MAX_THETA_Q31};
    for (uint32_t groups = 4; groups < 1024u; groups++) { /* where the block depends on them */
        uint16_t block;
        const int32_t retention = pvid_information_retention_q31(groups, &block);
        /*@ assert 0 < retention && 1 <= block <= 64; */
    }
    pvid_information_init_q31(&sums, &model, any_u32(1024, (uint32_t)1 << 24), 65536);
    for (uint8_t n_theta = 1; n_theta <= PVID_MAX_THETA_Q31; n_theta++) {
        model.n_theta = n_theta;
        any_model(&model);
    }
    model.n_kinds = 2;
    model.kind_end = two_end;
    any_model(&model);
    model.n_kinds = 3;
    model.kind_end = three_end;
    any_model(&model);
    model.n_kinds = 5;
    model.kind_end = many_end;
    any_model(&model);
}
