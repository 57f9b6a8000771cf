/* A row and a solve of the strong form: any normal equations that kapitza_project_q31.c makes, any row, any p, any
 * settings. What a shift leaves of a number, that is the choice of the shift: contracts here, of one line each. */
#include "prove.h"

#include "contracts.h"
#include "kapitza_contracts.h"
#include "kapitza_integer_q31.h"

/* ---- of other files ---- */

/*@ assigns self->sums[0 .. 57] \from self->sums[0 .. 57], row[0 .. 12];
    ensures 0 <= self->sums[57] <= 0x2000000000010000; */
void pvid_kapitza_add_q31(pvid_kapitza_estimator_q31 *self, const int32_t row[PVID_KAPITZA_ROW_Q31]);

/*@ assigns self->sums[0 .. 57], self->age, self->exponent \from self->sums[0 .. 57], self->age; */
void pvid_kapitza_end_row_q31(pvid_kapitza_estimator_q31 *self);

/* ---- of a shift ---- */

/*@ requires 0 <= s && -2000 <= g <= 2000;
    assigns \result \from s, g;
    ensures 0 <= \result <= 0x40000000; */
static int32_t equilibrated(int64_t s, int32_t g);

/*@ requires -0x100000000 <= s <= 0x100000000 && -2000 <= g <= 2000;
    assigns \result \from s, g;
    ensures -0x40000000 <= \result <= 0x40000000; */
static int32_t beside(int64_t s, int32_t g);

/*@ requires -0x7000000000000000 <= x <= 0x7000000000000000 && -4000 <= s <= 4000;
    assigns \result \from x, s;
    ensures -0x8000000 <= \result <= 0x8000000; */
static int32_t right_hand_side(int64_t x, int32_t s);

/*@ requires up <= 30 && 0 <= down <= 100;
    assigns \result \from y, up, down;
    ensures -0x8000000 <= \result <= 0x8000000; */
static int32_t lifted(int32_t y, uint32_t up, int32_t down);

/*@ requires 0x20000000 <= d <= 0x3FFFFFFF;
    assigns \result \from d;
    ensures 0x10000000 <= \result <= 0x20000000; */
static int32_t inverse_of(int32_t d);

/*@ requires 1 <= s && -1000 <= g <= 1000;
    assigns \result \from s, g;
    ensures 0x10000000 <= \result <= 0x40000000; */
static int32_t on_diagonal(int64_t s, int32_t g);

/*@ requires 1 <= x <= 0x3FFFFFFF;
    assigns \result, *up \from x;
    ensures \initialized(up) && *up <= 29;
    ensures 0x20000000 <= \result <= 0x3FFFFFFF; */
static int32_t raised(int32_t x, uint32_t *up);

#include "kapitza_solve_q31.c"

/*@ requires -0x40000000 <= x <= 0x40000000;
    assigns \result \from *factor, a, x;
    ensures -0x3FFFFFFF <= \result <= 0x3FFFFFFF; */
static int32_t entry_of_l(const factors *factor, size_t a, int32_t x);

static pvid_kapitza_estimator_q31 estimator;

static void any_state(void)
{
    for (size_t i = 0; i < PVID_SUM_WEIGHT; i++) {
        estimator.sums[i] = any_i64(-((int64_t)1 << 61), (int64_t)1 << 61);
    }
    estimator.sums[PVID_SUM_WEIGHT] = any_i64(0, (int64_t)1 << 61);
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        estimator.p[a] = any_i32(1, INT32_MAX);
        estimator.fresh[a] = any_i64(-PVID_WIDE, PVID_WIDE);
        estimator.settings.lower[a] = any_i32(1, INT32_MAX);
        estimator.settings.upper[a] = any_i32(1, INT32_MAX);
        estimator.settings.start_sd[a] = any_i32(1, INT32_MAX);
        estimator.settings.prior[a] = any_i32(0, INT32_MAX);
        estimator.settings.prior_exponent[a] = (int16_t)any_i32(-200, 200);
    }
    estimator.settings.n_p = PVID_KAPITZA_P;
    estimator.settings.positive = 7;
    estimator.settings.row_sd = any_i32(1, INT32_MAX);
    estimator.settings.gain = any_i32(0, PVID_ONE_Q30);
    estimator.settings.correlation = any_u32((uint32_t)1 << 16, (uint32_t)1 << 31);
    estimator.settings.step_limit = any_u32(1, 58982);
    estimator.settings.kappa_min = any_i32(0, PVID_ONE_Q30);
    estimator.settings.dead_zone = any_u32(0, (uint32_t)100 << 16);
    estimator.reference = any_i32(0, 2 * PVID_KAPITZA_RATE_LIMIT_Q31);
    estimator.bits[0] = (int8_t)any_i32(0, 60);
    estimator.bits[1] = (int8_t)any_i32(0, 60);
    estimator.exponent = (uint8_t)any_u32(0, 30);
    estimator.divider = (uint16_t)any_u32(1, 65535);
    estimator.phase = (uint16_t)any_u32(0, 65534);
    estimator.ready = true;
}

void main(void)
{
    int32_t row[PVID_KAPITZA_ROW_Q31];
    int32_t gradient[PVID_KAPITZA_P];
    for (size_t i = 0; i < PVID_KAPITZA_ROW_Q31; i++) {
        row[i] = any_i32(-2 * PVID_KAPITZA_RATE_LIMIT_Q31, 2 * PVID_KAPITZA_RATE_LIMIT_Q31);
    }
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        gradient[a] = any_i32(-PVID_ONE_Q30, PVID_ONE_Q30);
    }
    any_state();
    (void)pvid_kapitza_estimator_take_q31(&estimator, row, any_i32(-PVID_ROW_LIMIT_Q31, PVID_ROW_LIMIT_Q31), gradient);
    for (size_t a = 0; a < PVID_KAPITZA_P; a++) {
        /*@ assert 1 <= estimator.p[a]; */
    }
}
