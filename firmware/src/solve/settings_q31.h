/* The settings of a fixed-point estimator beside those of its model. Private to the core. */
#ifndef PVID_SOLVE_SETTINGS_Q31_H
#define PVID_SOLVE_SETTINGS_Q31_H

#include <stddef.h>
#include <stdint.h>

#include "pvid/estimator_q31.h"

/* The first field of these n_p parameters that is out of its range, or PVID_OK; bit i of positive: p[i] > 0. */
pvid_status pvid_settings_are_valid_q31(const pvid_estimator_config_q31 *config, uint8_t n_p, uint32_t positive);

/* What a solve needs of valid settings. */
void pvid_settings_init_q31(pvid_solve_settings_q31 *self, const pvid_estimator_config_q31 *config, uint8_t n_p,
                            uint32_t positive);

/* The hash of these settings, without those that an identifier fills in, continued from `hash`. */
uint32_t pvid_fingerprint_estimator_q31(uint32_t hash, const pvid_estimator_config_q31 *config, size_t n_theta,
                                        size_t n_p);

#endif
