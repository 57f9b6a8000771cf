/* pvid/sized.h - linker symbols that contain the array sizes, so that mismatched sizes are a link error.
 *
 * Library and application must be compiled with the same sizes (config.h): otherwise one writes beyond the end of the
 * other's objects. So every function with a parameter of one of the library's structs has a symbol of its own for each
 * set of sizes. An application with other sizes does not link, in C and C++, with a static or a shared library, and
 * the linker's message shows its sizes:
 *
 *     undefined reference to `pvid_weak_init_f32_window321_theta11_p6_moments55_...'
 *
 * Solution: set the sizes in one place for the library's sources and yours: a header of yours named by
 * -DPVID_CONFIG_HEADER, the CMake options, or the same -D for all files. Source code uses the plain names; the symbols
 * take no space in the image. PVID_PLAIN_NAMES disables the check, for tools that look up a function by its plain
 * name; such tools compare the sizes themselves.
 */
#ifndef PVID_SIZED_H
#define PVID_SIZED_H

/* Sizes of enumerations differ between compilers for ARM (-fshort-enums). */
#if defined(__ARM_SIZEOF_MINIMAL_ENUM)
#define PVID_ENUM_SIZE __ARM_SIZEOF_MINIMAL_ENUM
#else
#define PVID_ENUM_SIZE 0
#endif

#define PVID_SIZED_AS(name, window, theta, p, moments, decimation, functions, iterations, integers, moments_q31,       \
                      c_q31, samples, ring, inputs, channels, integrands, harmonics, kinds, columns, power, blocks,    \
                      windows, feedback, exact, plain, runs, signs, gains, exact_integrands, enums)                    \
    name##_window##window##_theta##theta##_p##p##_moments##moments##_decimation##decimation##_functions##functions##_iterations##iterations##_q31theta##integers##_q31moments##moments_q31##_q31c##c_q31##_samples##samples##_ring##ring##_inputs##inputs##_channels##channels##_integrands##integrands##_harmonics##harmonics##_kinds##kinds##_columns##columns##_power##power##_blocks##blocks##_windows##windows##_feedback##feedback##_exact##exact##_plain##plain##_runs##runs##_signs##signs##_gains##gains##_integrals##exact_integrands##_enum##enums
#define PVID_SIZED_OF(name, window, theta, p, moments, decimation, functions, iterations, integers, moments_q31,       \
                      c_q31, samples, ring, inputs, channels, integrands, harmonics, kinds, columns, power, blocks,    \
                      windows, feedback, exact, plain, runs, signs, gains, exact_integrands, enums)                    \
    PVID_SIZED_AS(name, window, theta, p, moments, decimation, functions, iterations, integers, moments_q31, c_q31,    \
                  samples, ring, inputs, channels, integrands, harmonics, kinds, columns, power, blocks, windows,      \
                  feedback, exact, plain, runs, signs, gains, exact_integrands, enums)
#define PVID_SIZED(name)                                                                                               \
    PVID_SIZED_OF(name, PVID_MAX_WINDOW, PVID_MAX_THETA, PVID_MAX_P, PVID_MAX_MOMENTS, PVID_MAX_DECIMATION,            \
                  PVID_MAX_FUNCTIONS, PVID_MAX_ITERATIONS, PVID_MAX_THETA_Q31, PVID_MAX_MOMENTS_Q31, PVID_MAX_C_Q31,   \
                  PVID_MAX_SAMPLES, PVID_MAX_RING, PVID_MAX_INPUTS, PVID_MAX_CHANNELS, PVID_MAX_INTEGRANDS,            \
                  PVID_MAX_HARMONICS, PVID_MAX_KINDS, PVID_MAX_COLUMNS, PVID_MAX_POWER, PVID_MAX_BLOCKS,               \
                  PVID_MAX_WINDOWS, PVID_FEEDBACK, PVID_EXACT, PVID_EXACT_PLAIN, PVID_EXACT_RUNS, PVID_EXACT_SIGNS,    \
                  PVID_EXACT_GAINS, PVID_EXACT_INTEGRANDS, PVID_ENUM_SIZE)

/* Symbols of the refinement contain its mechanism too (refine_shape.h): with another one it is a link error. */
#define PVID_REFINED_AS(name, id) name##_model##id
#define PVID_REFINED_OF(name, id) PVID_REFINED_AS(name, id)
#define PVID_REFINED(name) PVID_SIZED(PVID_REFINED_OF(name, PVID_REFINE_MODEL_ID))

/* differentiator.h */
#define pvid_differentiator_init_f32 PVID_SIZED(pvid_differentiator_init_f32)
#define pvid_differentiator_reset_f32 PVID_SIZED(pvid_differentiator_reset_f32)
#define pvid_differentiator_step_f32 PVID_SIZED(pvid_differentiator_step_f32)

/* differentiator_q31.h */
#define pvid_differentiator_init_q31 PVID_SIZED(pvid_differentiator_init_q31)
#define pvid_differentiator_reset_q31 PVID_SIZED(pvid_differentiator_reset_q31)
#define pvid_differentiator_step_q31 PVID_SIZED(pvid_differentiator_step_q31)

/* estimator.h */
#define pvid_estimator_init_f32 PVID_SIZED(pvid_estimator_init_f32)
#define pvid_estimator_step_f32 PVID_SIZED(pvid_estimator_step_f32)
#define pvid_estimator_add_f32 PVID_SIZED(pvid_estimator_add_f32)
#define pvid_estimator_add_kind_f32 PVID_SIZED(pvid_estimator_add_kind_f32)
#define pvid_estimator_add_to_b_f32 PVID_SIZED(pvid_estimator_add_to_b_f32)
#define pvid_estimator_update_f32 PVID_SIZED(pvid_estimator_update_f32)
#define pvid_estimator_iterate_f32 PVID_SIZED(pvid_estimator_iterate_f32)
#define pvid_estimator_begin_f32 PVID_SIZED(pvid_estimator_begin_f32)
#define pvid_estimator_advance_f32 PVID_SIZED(pvid_estimator_advance_f32)
#define pvid_estimator_stages_f32 PVID_SIZED(pvid_estimator_stages_f32)
#define pvid_estimator_place_f32 PVID_SIZED(pvid_estimator_place_f32)
#define pvid_estimator_assess_f32 PVID_SIZED(pvid_estimator_assess_f32)
#define pvid_estimator_begin_assessment_f32 PVID_SIZED(pvid_estimator_begin_assessment_f32)
#define pvid_estimator_assess_advance_f32 PVID_SIZED(pvid_estimator_assess_advance_f32)
#define pvid_estimator_assessment_stages_f32 PVID_SIZED(pvid_estimator_assessment_stages_f32)
#define pvid_estimator_defaults_f32 PVID_SIZED(pvid_estimator_defaults_f32)

/* estimator_q31.h */
#define pvid_estimator_init_q31 PVID_SIZED(pvid_estimator_init_q31)
#define pvid_estimator_place_q31 PVID_SIZED(pvid_estimator_place_q31)
#define pvid_estimator_add_q31 PVID_SIZED(pvid_estimator_add_q31)
#define pvid_estimator_add_kind_q31 PVID_SIZED(pvid_estimator_add_kind_q31)
#define pvid_estimator_add_to_b_q31 PVID_SIZED(pvid_estimator_add_to_b_q31)
#define pvid_estimator_update_q31 PVID_SIZED(pvid_estimator_update_q31)
#define pvid_estimator_iterate_q31 PVID_SIZED(pvid_estimator_iterate_q31)
#define pvid_estimator_begin_q31 PVID_SIZED(pvid_estimator_begin_q31)
#define pvid_estimator_advance_q31 PVID_SIZED(pvid_estimator_advance_q31)
#define pvid_estimator_stages_q31 PVID_SIZED(pvid_estimator_stages_q31)
#define pvid_estimator_assess_q31 PVID_SIZED(pvid_estimator_assess_q31)
#define pvid_estimator_begin_assessment_q31 PVID_SIZED(pvid_estimator_begin_assessment_q31)
#define pvid_estimator_assess_advance_q31 PVID_SIZED(pvid_estimator_assess_advance_q31)
#define pvid_estimator_assessment_stages_q31 PVID_SIZED(pvid_estimator_assessment_stages_q31)

/* fnv.h */
#define pvid_fnv_estimator_f32 PVID_SIZED(pvid_fnv_estimator_f32)

/* fnv_q31.h */
#define pvid_fnv_estimator_q31 PVID_SIZED(pvid_fnv_estimator_q31)

/* weak.h */
#define pvid_weak_init_f32 PVID_SIZED(pvid_weak_init_f32)
#define pvid_weak_step_f32 PVID_SIZED(pvid_weak_step_f32)
#define pvid_weak_estimate_f32 PVID_SIZED(pvid_weak_estimate_f32)
#define pvid_weak_read_f32 PVID_SIZED(pvid_weak_read_f32)
#define pvid_weak_gap_f32 PVID_SIZED(pvid_weak_gap_f32)
#define pvid_weak_freeze_f32 PVID_SIZED(pvid_weak_freeze_f32)
#define pvid_weak_candidate_f32 PVID_SIZED(pvid_weak_candidate_f32)

/* weak_q31.h */
#define pvid_weak_init_q31 PVID_SIZED(pvid_weak_init_q31)
#define pvid_weak_step_q31 PVID_SIZED(pvid_weak_step_q31)
#define pvid_weak_estimate_q31 PVID_SIZED(pvid_weak_estimate_q31)
#define pvid_weak_read_q31 PVID_SIZED(pvid_weak_read_q31)
#define pvid_weak_gap_q31 PVID_SIZED(pvid_weak_gap_q31)
#define pvid_weak_freeze_q31 PVID_SIZED(pvid_weak_freeze_q31)

/* gate.h */
#define pvid_gate_init_f32 PVID_SIZED(pvid_gate_init_f32)
#define pvid_gate_passes_f32 PVID_SIZED(pvid_gate_passes_f32)
#define pvid_gate_judge_f32 PVID_SIZED(pvid_gate_judge_f32)

/* gate_q31.h */
#define pvid_gate_init_q31 PVID_SIZED(pvid_gate_init_q31)
#define pvid_gate_passes_q31 PVID_SIZED(pvid_gate_passes_q31)
#define pvid_gate_judge_q31 PVID_SIZED(pvid_gate_judge_q31)

/* information.h */
#define pvid_information_init_f32 PVID_SIZED(pvid_information_init_f32)
#define pvid_information_add_f32 PVID_SIZED(pvid_information_add_f32)
#define pvid_information_end_group_f32 PVID_SIZED(pvid_information_end_group_f32)
#define pvid_information_fade_f32 PVID_SIZED(pvid_information_fade_f32)
#define pvid_information_read_f32 PVID_SIZED(pvid_information_read_f32)
#define pvid_information_tail_f32 PVID_SIZED(pvid_information_tail_f32)

/* publication.h */
#define pvid_publication_put_f32 PVID_SIZED(pvid_publication_put_f32)
#define pvid_publication_read_f32 PVID_SIZED(pvid_publication_read_f32)

/* publication_q31.h */
#define pvid_publication_put_q31 PVID_SIZED(pvid_publication_put_q31)
#define pvid_publication_read_q31 PVID_SIZED(pvid_publication_read_q31)

/* snapshot.h */
#define pvid_snapshot_save_strong_f32 PVID_SIZED(pvid_snapshot_save_strong_f32)
#define pvid_snapshot_save_strong_q31 PVID_SIZED(pvid_snapshot_save_strong_q31)
#define pvid_snapshot_restore_strong_f32 PVID_SIZED(pvid_snapshot_restore_strong_f32)
#define pvid_snapshot_restore_strong_q31 PVID_SIZED(pvid_snapshot_restore_strong_q31)

/* refine.h */
#define pvid_refine_init_f32 PVID_REFINED(pvid_refine_init_f32)
#define pvid_refine_step_f32 PVID_REFINED(pvid_refine_step_f32)
#define pvid_refine_best_f32 PVID_REFINED(pvid_refine_best_f32)
#define pvid_refine_latest_f32 PVID_REFINED(pvid_refine_latest_f32)
#define pvid_refine_read_f32 PVID_REFINED(pvid_refine_read_f32)
#define pvid_refine_gap_f32 PVID_REFINED(pvid_refine_gap_f32)
#define pvid_refine_freeze_f32 PVID_REFINED(pvid_refine_freeze_f32)
#define pvid_refine_reason_f32 PVID_REFINED(pvid_refine_reason_f32)
#define pvid_refine_stage_f32 PVID_REFINED(pvid_refine_stage_f32)

/* fnv_refine.h */
#define pvid_fnv_refine_f32 PVID_REFINED(pvid_fnv_refine_f32)

/* snapshot_weak.h */
#define pvid_snapshot_save_weak_f32 PVID_SIZED(pvid_snapshot_save_weak_f32)
#define pvid_snapshot_restore_weak_f32 PVID_SIZED(pvid_snapshot_restore_weak_f32)

/* snapshot_refine.h */
#define pvid_snapshot_save_refine_f32 PVID_REFINED(pvid_snapshot_save_refine_f32)
#define pvid_snapshot_restore_refine_f32 PVID_REFINED(pvid_snapshot_restore_refine_f32)

/* snapshot_weak_q31.h */
#define pvid_snapshot_save_weak_q31 PVID_SIZED(pvid_snapshot_save_weak_q31)
#define pvid_snapshot_restore_weak_q31 PVID_SIZED(pvid_snapshot_restore_weak_q31)

/* strong.h */
#define pvid_strong_init_f32 PVID_SIZED(pvid_strong_init_f32)
#define pvid_strong_step_f32 PVID_SIZED(pvid_strong_step_f32)
#define pvid_strong_row_step_f32 PVID_SIZED(pvid_strong_row_step_f32)
#define pvid_strong_assess_f32 PVID_SIZED(pvid_strong_assess_f32)
#define pvid_strong_read_sums_f32 PVID_SIZED(pvid_strong_read_sums_f32)
#define pvid_fnv_strong_f32 PVID_SIZED(pvid_fnv_strong_f32)
#define pvid_strong_gap_f32 PVID_SIZED(pvid_strong_gap_f32)
#define pvid_strong_freeze_f32 PVID_SIZED(pvid_strong_freeze_f32)

/* strong_q31.h */
#define pvid_strong_init_q31 PVID_SIZED(pvid_strong_init_q31)
#define pvid_strong_step_q31 PVID_SIZED(pvid_strong_step_q31)
#define pvid_fnv_strong_q31 PVID_SIZED(pvid_fnv_strong_q31)
#define pvid_strong_gap_q31 PVID_SIZED(pvid_strong_gap_q31)
#define pvid_strong_freeze_q31 PVID_SIZED(pvid_strong_freeze_q31)

/* trust.h */
#define pvid_trust_init_f32 PVID_SIZED(pvid_trust_init_f32)
#define pvid_trust_place_f32 PVID_SIZED(pvid_trust_place_f32)
#define pvid_trust_renew_f32 PVID_SIZED(pvid_trust_renew_f32)
#define pvid_trust_begin_anew_f32 PVID_SIZED(pvid_trust_begin_anew_f32)
#define pvid_trust_fade_factor_f32 PVID_SIZED(pvid_trust_fade_factor_f32)
#define pvid_trust_largest_error_f32 PVID_SIZED(pvid_trust_largest_error_f32)
#define pvid_trust_fallback_f32 PVID_SIZED(pvid_trust_fallback_f32)
#define pvid_trust_judge_f32 PVID_SIZED(pvid_trust_judge_f32)

/* trust_q31.h */
#define pvid_trust_init_q31 PVID_SIZED(pvid_trust_init_q31)
#define pvid_trust_place_q31 PVID_SIZED(pvid_trust_place_q31)
#define pvid_trust_begin_anew_q31 PVID_SIZED(pvid_trust_begin_anew_q31)
#define pvid_trust_fade_factor_q31 PVID_SIZED(pvid_trust_fade_factor_q31)
#define pvid_trust_fallback_q31 PVID_SIZED(pvid_trust_fallback_q31)
#define pvid_trust_judge_q31 PVID_SIZED(pvid_trust_judge_q31)

#endif
