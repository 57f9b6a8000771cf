/* What init of the refinement refuses. Private to the core. */
#ifndef PVID_REFINE_VALID_F32_H
#define PVID_REFINE_VALID_F32_H

#include "pvid/refine.h"

pvid_status pvid_refine_valid_f32(const pvid_refine_config_f32 *config, size_t samples);

#endif
