/* weak_window_q31: a window of a design as it fills, any F and U within their limits and any second differences; from
 * its first sample, and from its middle, as after a gap. Every sum of its products fits. */
#include "prove.h"

#include "contracts.h"
#include "weak_design.h"
#include "weak/window_q31.h"

static pvid_weak_window_q31 window;
static int32_t term[PVID_WEAK_TERMS_Q31];
static int32_t sums[PVID_MAX_FUNCTIONS][PVID_WEAK_TERMS_Q31];

/* As pvid_weak_gap_q31 leaves it, whatever it was; or as it stands when it has come round: index 0 clears it. */
static void any_window(const pvid_weak_design_q31 *design, uint16_t first)
{
    const int32_t f_max = (int32_t)largest_f(design);
    const int64_t bend_max = 4 * (int64_t)f_max;
    for (uint16_t index = first; index < design->window - 1u; index++) {
        const pvid_weak_curvature_q31 curvature = {.due = any_bool(), .square = any_i64(0, bend_max * bend_max)};
        const int32_t f = any_i32(-f_max, f_max);
        const int32_t u = any_i32(-design->u_max, design->u_max);
        window.index = index;
        pvid_weak_window_terms_q31(&window, design, f, u, &curvature, term);
        pvid_weak_window_add_q31(&window, design, term, 0, design->functions, sums);
    }
    for (size_t i = 0; i < PVID_WEAK_TERMS_Q31; i++) {
        for (size_t k = 0; k < design->functions; k++) {
            /*@ assert -largest_sum[i] <= sums[k][i] <= largest_sum[i]; */
        }
    }
    (void)pvid_weak_window_drive_q31(&window, design->window);
    for (uint16_t curvatures = 0; curvatures < design->window; curvatures++) { /* one that divides each time */
        window.curvatures = curvatures;
        (void)pvid_weak_window_curvature_q31(&window);
    }
}

void main(void)
{
    any_window(&weak_unit_design, (weak_unit_design.window - 1u) / 2u);
    any_window(&weak_unit_design, 0);
    any_window(&weak_unit_design, 0);
}
