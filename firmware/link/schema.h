/* Made by `pvid schema`: do not edit. The fields are explained in host/src/pvid/link/frames.py. */
#ifndef PVID_SCHEMA_H
#define PVID_SCHEMA_H

#include "pvid/config.h"

/* Places for parameters in a frame, and what depends on them. */
#if PVID_MAX_P > 8
#define PVID_LINK_PLACES(narrow, wide) wide
#else
#define PVID_LINK_PLACES(narrow, wide) narrow
#endif
#define PVID_LINK_P PVID_LINK_PLACES(8u, 16u)

#define PVID_LINK_VERSION 1u

/* CRC-32 of the text. Frames without parameters are the same in both. */
#define PVID_LINK_NARROW_SCHEMA 0x73E49A2Au
#define PVID_LINK_SCHEMA PVID_LINK_PLACES(PVID_LINK_NARROW_SCHEMA, 0x41375251u)

#define PVID_LINK_SCHEMA_TEXT \
    "pvid 1\n" \
    PVID_LINK_PLACES("1 hello form:u8 core:u8 n_p:u8 window:u16 settings:u32 session:u32 sample_rate:f32 phi_lsb:f32 y_lsb:f32 p_unit:f32[8] board:char[16] tick_high:u16 samples:u8\n", "1 hello form:u8 core:u8 n_p:u8 window:u16 settings:u32 session:u32 sample_rate:f32 phi_lsb:f32 y_lsb:f32 p_unit:f32[16] board:char[16] tick_high:u16 samples:u8\n") \
    "2 schema text:char[]\n" \
    PVID_LINK_PLACES("3 configure session:u32 settings:u32 form:u8 source:u8 hash_every:u16 estimate_every:u16 divider:u16 law:u8 start:f32[8] start_sd:f32[8] lower:f32[8] upper:f32[8] row_sd:f32 forgetting_s:f32 feedback_hz:f32 first_tick:u64\n", "3 configure session:u32 settings:u32 form:u8 source:u8 hash_every:u16 estimate_every:u16 divider:u16 law:u8 start:f32[16] start_sd:f32[16] lower:f32[16] upper:f32[16] row_sd:f32 forgetting_s:f32 feedback_hz:f32 first_tick:u64\n") \
    "4 sample data:f32[]\n" \
    "5 raw session:u32 tick_high:u16 samples:u8 data:f32[]\n" \
    PVID_LINK_PLACES("6 estimate session:u32 updates:u32 p:f32[8] covariance:f32[36] kappa:f32 residual_sd:f32 weight:f32 reason:u8 tick_high:u16 standing:u32\n", "6 estimate session:u32 updates:u32 p:f32[16] covariance:f32[136] kappa:f32 residual_sd:f32 weight:f32 reason:u8 tick_high:u16 standing:u32\n") \
    "7 status session:u32 code:u8 core:u8 updates:u32 rejected:u32 repeated:u32 skipped:u32 missing:u32 malformed:u32 bad_crc:u32 foreign:u32 tick_high:u16\n" \
    "8 hash session:u32 hash:u32 tick_high:u16 sample_hash:u32\n" \
    "9 credit session:u32 room:u32 hash:u32 reason:u8 tick_high:u16 sample_hash:u32\n" \
    PVID_LINK_PLACES("10 configure_q31 session:u32 settings:u32 form:u8 source:u8 hash_every:u16 estimate_every:u16 divider:u16 start:i32[8] start_sd:i32[8] lower:i32[8] upper:i32[8] row_sd:i32 forgetting_groups:u32 gain:i32 phi_offset:i32 y_offset:i32 first_tick:u64\n", "10 configure_q31 session:u32 settings:u32 form:u8 source:u8 hash_every:u16 estimate_every:u16 divider:u16 start:i32[16] start_sd:i32[16] lower:i32[16] upper:i32[16] row_sd:i32 forgetting_groups:u32 gain:i32 phi_offset:i32 y_offset:i32 first_tick:u64\n") \
    "11 count data:i32[]\n" \
    "12 raw_count session:u32 tick_high:u16 samples:u8 data:i32[]\n" \
    PVID_LINK_PLACES("13 estimate_q31 session:u32 updates:u32 p:i32[8] se:i32[8] correlation:i32[36] kappa:i32 residual_sd:i32 weight:u32 reason:u8 tick_high:u16 standing:u32\n", "13 estimate_q31 session:u32 updates:u32 p:i32[16] se:i32[16] correlation:i32[136] kappa:i32 residual_sd:i32 weight:u32 reason:u8 tick_high:u16 standing:u32\n") \
    "14 names text:char[]\n" \
    PVID_LINK_PLACES("15 refined_estimate session:u32 number:u32 p:f32[8] covariance:f32[36] r:f32[8] se:f32[8] level:f32 clash:f32 reason:u8 stage:u8 tick_high:u16", "15 refined_estimate session:u32 number:u32 p:f32[16] covariance:f32[136] r:f32[16] se:f32[16] level:f32 clash:f32 reason:u8 stage:u8 tick_high:u16")

/* Frame types; offsets of their fields and the bytes before an open end. */

#define PVID_HELLO 1u
#define PVID_HELLO_FORM 0u /* u8 */
#define PVID_HELLO_CORE 1u /* u8 */
#define PVID_HELLO_N_P 2u /* u8 */
#define PVID_HELLO_WINDOW 3u /* u16 */
#define PVID_HELLO_SETTINGS 5u /* u32 */
#define PVID_HELLO_SESSION 9u /* u32 */
#define PVID_HELLO_SAMPLE_RATE 13u /* f32 */
#define PVID_HELLO_PHI_LSB 17u /* f32 */
#define PVID_HELLO_Y_LSB 21u /* f32 */
#define PVID_HELLO_P_UNIT 25u /* f32[8 or 16] */
#define PVID_HELLO_BOARD PVID_LINK_PLACES(57u, 89u) /* char[16] */
#define PVID_HELLO_TICK_HIGH PVID_LINK_PLACES(73u, 105u) /* u16 */
#define PVID_HELLO_SAMPLES PVID_LINK_PLACES(75u, 107u) /* u8 */
#define PVID_HELLO_BYTES PVID_LINK_PLACES(76u, 108u)

#define PVID_SCHEMA 2u
#define PVID_SCHEMA_TEXT 0u /* char[] */
#define PVID_SCHEMA_BYTES 0u

#define PVID_CONFIGURE 3u
#define PVID_CONFIGURE_SESSION 0u /* u32 */
#define PVID_CONFIGURE_SETTINGS 4u /* u32 */
#define PVID_CONFIGURE_FORM 8u /* u8 */
#define PVID_CONFIGURE_SOURCE 9u /* u8 */
#define PVID_CONFIGURE_HASH_EVERY 10u /* u16 */
#define PVID_CONFIGURE_ESTIMATE_EVERY 12u /* u16 */
#define PVID_CONFIGURE_DIVIDER 14u /* u16 */
#define PVID_CONFIGURE_LAW 16u /* u8 */
#define PVID_CONFIGURE_START 17u /* f32[8 or 16] */
#define PVID_CONFIGURE_START_SD PVID_LINK_PLACES(49u, 81u) /* f32[8 or 16] */
#define PVID_CONFIGURE_LOWER PVID_LINK_PLACES(81u, 145u) /* f32[8 or 16] */
#define PVID_CONFIGURE_UPPER PVID_LINK_PLACES(113u, 209u) /* f32[8 or 16] */
#define PVID_CONFIGURE_ROW_SD PVID_LINK_PLACES(145u, 273u) /* f32 */
#define PVID_CONFIGURE_FORGETTING_S PVID_LINK_PLACES(149u, 277u) /* f32 */
#define PVID_CONFIGURE_FEEDBACK_HZ PVID_LINK_PLACES(153u, 281u) /* f32 */
#define PVID_CONFIGURE_FIRST_TICK PVID_LINK_PLACES(157u, 285u) /* u64 */
#define PVID_CONFIGURE_BYTES PVID_LINK_PLACES(165u, 293u)

#define PVID_SAMPLE 4u
#define PVID_SAMPLE_DATA 0u /* f32[] */
#define PVID_SAMPLE_BYTES 0u

#define PVID_RAW 5u
#define PVID_RAW_SESSION 0u /* u32 */
#define PVID_RAW_TICK_HIGH 4u /* u16 */
#define PVID_RAW_SAMPLES 6u /* u8 */
#define PVID_RAW_DATA 7u /* f32[] */
#define PVID_RAW_BYTES 7u

#define PVID_ESTIMATE 6u
#define PVID_ESTIMATE_SESSION 0u /* u32 */
#define PVID_ESTIMATE_UPDATES 4u /* u32 */
#define PVID_ESTIMATE_P 8u /* f32[8 or 16] */
#define PVID_ESTIMATE_COVARIANCE PVID_LINK_PLACES(40u, 72u) /* f32[36 or 136] */
#define PVID_ESTIMATE_KAPPA PVID_LINK_PLACES(184u, 616u) /* f32 */
#define PVID_ESTIMATE_RESIDUAL_SD PVID_LINK_PLACES(188u, 620u) /* f32 */
#define PVID_ESTIMATE_WEIGHT PVID_LINK_PLACES(192u, 624u) /* f32 */
#define PVID_ESTIMATE_REASON PVID_LINK_PLACES(196u, 628u) /* u8 */
#define PVID_ESTIMATE_TICK_HIGH PVID_LINK_PLACES(197u, 629u) /* u16 */
#define PVID_ESTIMATE_STANDING PVID_LINK_PLACES(199u, 631u) /* u32 */
#define PVID_ESTIMATE_BYTES PVID_LINK_PLACES(203u, 635u)

#define PVID_STATUS 7u
#define PVID_STATUS_SESSION 0u /* u32 */
#define PVID_STATUS_CODE 4u /* u8 */
#define PVID_STATUS_CORE 5u /* u8 */
#define PVID_STATUS_UPDATES 6u /* u32 */
#define PVID_STATUS_REJECTED 10u /* u32 */
#define PVID_STATUS_REPEATED 14u /* u32 */
#define PVID_STATUS_SKIPPED 18u /* u32 */
#define PVID_STATUS_MISSING 22u /* u32 */
#define PVID_STATUS_MALFORMED 26u /* u32 */
#define PVID_STATUS_BAD_CRC 30u /* u32 */
#define PVID_STATUS_FOREIGN 34u /* u32 */
#define PVID_STATUS_TICK_HIGH 38u /* u16 */
#define PVID_STATUS_BYTES 40u

#define PVID_HASH 8u
#define PVID_HASH_SESSION 0u /* u32 */
#define PVID_HASH_HASH 4u /* u32 */
#define PVID_HASH_TICK_HIGH 8u /* u16 */
#define PVID_HASH_SAMPLE_HASH 10u /* u32 */
#define PVID_HASH_BYTES 14u

#define PVID_CREDIT 9u
#define PVID_CREDIT_SESSION 0u /* u32 */
#define PVID_CREDIT_ROOM 4u /* u32 */
#define PVID_CREDIT_HASH 8u /* u32 */
#define PVID_CREDIT_REASON 12u /* u8 */
#define PVID_CREDIT_TICK_HIGH 13u /* u16 */
#define PVID_CREDIT_SAMPLE_HASH 15u /* u32 */
#define PVID_CREDIT_BYTES 19u

#define PVID_CONFIGURE_Q31 10u
#define PVID_CONFIGURE_Q31_SESSION 0u /* u32 */
#define PVID_CONFIGURE_Q31_SETTINGS 4u /* u32 */
#define PVID_CONFIGURE_Q31_FORM 8u /* u8 */
#define PVID_CONFIGURE_Q31_SOURCE 9u /* u8 */
#define PVID_CONFIGURE_Q31_HASH_EVERY 10u /* u16 */
#define PVID_CONFIGURE_Q31_ESTIMATE_EVERY 12u /* u16 */
#define PVID_CONFIGURE_Q31_DIVIDER 14u /* u16 */
#define PVID_CONFIGURE_Q31_START 16u /* i32[8 or 16] */
#define PVID_CONFIGURE_Q31_START_SD PVID_LINK_PLACES(48u, 80u) /* i32[8 or 16] */
#define PVID_CONFIGURE_Q31_LOWER PVID_LINK_PLACES(80u, 144u) /* i32[8 or 16] */
#define PVID_CONFIGURE_Q31_UPPER PVID_LINK_PLACES(112u, 208u) /* i32[8 or 16] */
#define PVID_CONFIGURE_Q31_ROW_SD PVID_LINK_PLACES(144u, 272u) /* i32 */
#define PVID_CONFIGURE_Q31_FORGETTING_GROUPS PVID_LINK_PLACES(148u, 276u) /* u32 */
#define PVID_CONFIGURE_Q31_GAIN PVID_LINK_PLACES(152u, 280u) /* i32 */
#define PVID_CONFIGURE_Q31_PHI_OFFSET PVID_LINK_PLACES(156u, 284u) /* i32 */
#define PVID_CONFIGURE_Q31_Y_OFFSET PVID_LINK_PLACES(160u, 288u) /* i32 */
#define PVID_CONFIGURE_Q31_FIRST_TICK PVID_LINK_PLACES(164u, 292u) /* u64 */
#define PVID_CONFIGURE_Q31_BYTES PVID_LINK_PLACES(172u, 300u)

#define PVID_COUNT 11u
#define PVID_COUNT_DATA 0u /* i32[] */
#define PVID_COUNT_BYTES 0u

#define PVID_RAW_COUNT 12u
#define PVID_RAW_COUNT_SESSION 0u /* u32 */
#define PVID_RAW_COUNT_TICK_HIGH 4u /* u16 */
#define PVID_RAW_COUNT_SAMPLES 6u /* u8 */
#define PVID_RAW_COUNT_DATA 7u /* i32[] */
#define PVID_RAW_COUNT_BYTES 7u

#define PVID_ESTIMATE_Q31 13u
#define PVID_ESTIMATE_Q31_SESSION 0u /* u32 */
#define PVID_ESTIMATE_Q31_UPDATES 4u /* u32 */
#define PVID_ESTIMATE_Q31_P 8u /* i32[8 or 16] */
#define PVID_ESTIMATE_Q31_SE PVID_LINK_PLACES(40u, 72u) /* i32[8 or 16] */
#define PVID_ESTIMATE_Q31_CORRELATION PVID_LINK_PLACES(72u, 136u) /* i32[36 or 136] */
#define PVID_ESTIMATE_Q31_KAPPA PVID_LINK_PLACES(216u, 680u) /* i32 */
#define PVID_ESTIMATE_Q31_RESIDUAL_SD PVID_LINK_PLACES(220u, 684u) /* i32 */
#define PVID_ESTIMATE_Q31_WEIGHT PVID_LINK_PLACES(224u, 688u) /* u32 */
#define PVID_ESTIMATE_Q31_REASON PVID_LINK_PLACES(228u, 692u) /* u8 */
#define PVID_ESTIMATE_Q31_TICK_HIGH PVID_LINK_PLACES(229u, 693u) /* u16 */
#define PVID_ESTIMATE_Q31_STANDING PVID_LINK_PLACES(231u, 695u) /* u32 */
#define PVID_ESTIMATE_Q31_BYTES PVID_LINK_PLACES(235u, 699u)

#define PVID_NAMES 14u
#define PVID_NAMES_TEXT 0u /* char[] */
#define PVID_NAMES_BYTES 0u

#define PVID_REFINED_ESTIMATE 15u
#define PVID_REFINED_ESTIMATE_SESSION 0u /* u32 */
#define PVID_REFINED_ESTIMATE_NUMBER 4u /* u32 */
#define PVID_REFINED_ESTIMATE_P 8u /* f32[8 or 16] */
#define PVID_REFINED_ESTIMATE_COVARIANCE PVID_LINK_PLACES(40u, 72u) /* f32[36 or 136] */
#define PVID_REFINED_ESTIMATE_R PVID_LINK_PLACES(184u, 616u) /* f32[8 or 16] */
#define PVID_REFINED_ESTIMATE_SE PVID_LINK_PLACES(216u, 680u) /* f32[8 or 16] */
#define PVID_REFINED_ESTIMATE_LEVEL PVID_LINK_PLACES(248u, 744u) /* f32 */
#define PVID_REFINED_ESTIMATE_CLASH PVID_LINK_PLACES(252u, 748u) /* f32 */
#define PVID_REFINED_ESTIMATE_REASON PVID_LINK_PLACES(256u, 752u) /* u8 */
#define PVID_REFINED_ESTIMATE_STAGE PVID_LINK_PLACES(257u, 753u) /* u8 */
#define PVID_REFINED_ESTIMATE_TICK_HIGH PVID_LINK_PLACES(258u, 754u) /* u16 */
#define PVID_REFINED_ESTIMATE_BYTES PVID_LINK_PLACES(260u, 756u)

/* Status.code */
#define PVID_CODE_WAITING 0u
#define PVID_CODE_RUNNING 1u
#define PVID_CODE_REFUSED_BY_CORE 2u
#define PVID_CODE_REFUSED_SETTINGS 3u
#define PVID_CODE_REFUSED_FORM 4u
#define PVID_CODE_ARITHMETIC 5u
#define PVID_CODE_REFUSED_SOURCE 6u

/* Hello.form */
#define PVID_FORM_STRONG 0u
#define PVID_FORM_WEAK 2u

/* Hello.core */
#define PVID_CORE_F32 0u
#define PVID_CORE_Q31 1u

/* Configure.source */
#define PVID_SOURCE_PC 0u
#define PVID_SOURCE_SENSOR 1u
#define PVID_SOURCE_SENSOR_PACED 2u

#endif
