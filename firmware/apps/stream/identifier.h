/* The identifier behind the link: the core and form of stream_rig.h, one source file per core.
 *
 * Settings, samples and estimates have the layout of that core's frames (link/schema.h).
 */
#ifndef IDENTIFIER_H
#define IDENTIFIER_H

#include <stdint.h>

#include "link.h"
#include "pvid/config.h"
#include "pvid/status.h"
#include "stream_rig.h"

#if STREAM_CORE == 1 /* PVID_CORE_Q31 */
#define IDENTIFIER_CONFIGURE PVID_CONFIGURE_Q31
#define IDENTIFIER_CONFIGURE_BYTES PVID_CONFIGURE_Q31_BYTES
#define IDENTIFIER_CONFIGURE_FIRST_TICK PVID_CONFIGURE_Q31_FIRST_TICK
#define IDENTIFIER_SAMPLE PVID_COUNT
#define IDENTIFIER_RAW PVID_RAW_COUNT
#define IDENTIFIER_RAW_BYTES PVID_RAW_COUNT_BYTES /* before the samples */
#define IDENTIFIER_RAW_SESSION PVID_RAW_COUNT_SESSION
#define IDENTIFIER_RAW_TICK_HIGH PVID_RAW_COUNT_TICK_HIGH
#define IDENTIFIER_RAW_SAMPLES PVID_RAW_COUNT_SAMPLES
#define IDENTIFIER_ESTIMATE PVID_ESTIMATE_Q31
#define IDENTIFIER_ESTIMATE_BYTES PVID_ESTIMATE_Q31_BYTES
#define IDENTIFIER_ESTIMATE_TICK_HIGH PVID_ESTIMATE_Q31_TICK_HIGH
#else
#define IDENTIFIER_CONFIGURE PVID_CONFIGURE
#define IDENTIFIER_CONFIGURE_BYTES PVID_CONFIGURE_BYTES
#define IDENTIFIER_CONFIGURE_FIRST_TICK PVID_CONFIGURE_FIRST_TICK
#define IDENTIFIER_SAMPLE PVID_SAMPLE
#define IDENTIFIER_RAW PVID_RAW
#define IDENTIFIER_RAW_BYTES PVID_RAW_BYTES /* before the samples */
#define IDENTIFIER_RAW_SESSION PVID_RAW_SESSION
#define IDENTIFIER_RAW_TICK_HIGH PVID_RAW_TICK_HIGH
#define IDENTIFIER_RAW_SAMPLES PVID_RAW_SAMPLES
#define IDENTIFIER_ESTIMATE PVID_ESTIMATE
#define IDENTIFIER_ESTIMATE_BYTES PVID_ESTIMATE_BYTES
#define IDENTIFIER_ESTIMATE_TICK_HIGH PVID_ESTIMATE_TICK_HIGH
#endif

#define SAMPLE_BYTES (4u * STREAM_SAMPLES) /* the samples of a tick in a frame */

/* Faults of the arithmetic that the bits hang on; 0 where there are none. */
uint32_t identifier_arithmetic_faults(void);

/* Starts over with the settings of a Configure frame. */
pvid_status identifier_start(const uint8_t payload[IDENTIFIER_CONFIGURE_BYTES]);

pvid_reason identifier_step(const uint8_t sample[SAMPLE_BYTES]);

/* The running hash (fnv.h) with the present state and `reason`. */
uint32_t identifier_hash(uint32_t hash, pvid_reason reason);

/* The payload of an Estimate frame, without the upper bits of its tick. */
void identifier_estimate(uint8_t payload[IDENTIFIER_ESTIMATE_BYTES], uint32_t session, pvid_reason reason);

#ifdef STREAM_REFINED
/* The payload of a RefinedEstimate frame, without the upper bits of its tick. */
void identifier_refined(uint8_t payload[PVID_REFINED_ESTIMATE_BYTES], uint32_t session);
#endif

const pvid_counters *identifier_counters(void);

#endif
