/* Made by `pvid link-schema` from host/src/pvid/link.py, which says what the fields mean: do not edit. */
#ifndef PVID_SCHEMA_H
#define PVID_SCHEMA_H

#define PVID_LINK_VERSION 1u

/* CRC-32 of the text. */
#define PVID_LINK_SCHEMA 0xC04A322Cu

#define PVID_LINK_SCHEMA_TEXT \
    "pvid 1\n" \
    "1 hello form:u8 n_p:u8 window:u16 settings:u32 session:u32 board:char[16]\n" \
    "2 schema text:char[]\n" \
    "3 configure session:u32 settings:u32 form:u8 law:u8 divider:u16 hash_every:u16 estimate_every:u16 start:f32[6] start_sd:f32[6] lower:f32[6] upper:f32[6] row_sd:f32 forgetting_s:f32 feedback_hz:f32\n" \
    "4 sample phi_y:f32[]\n" \
    "5 raw phi_y:f32[]\n" \
    "6 estimate session:u32 updates:u32 p:f32[6] covariance:f32[21] kappa:f32 residual_sd:f32 weight:f32 reason:u8\n" \
    "7 status session:u32 code:u8 core:u8 updates:u32 rejected:u32 repeated:u32 skipped:u32 missing:u32 malformed:u32 bad_crc:u32 foreign:u32\n" \
    "8 hash session:u32 hash:u32\n" \
    "9 credit session:u32 room:u32 hash:u32 reason:u8"

/* Frame types; offsets of their fields and the bytes before an open end. */

#define PVID_HELLO 1u
#define PVID_HELLO_FORM 0u /* u8 */
#define PVID_HELLO_N_P 1u /* u8 */
#define PVID_HELLO_WINDOW 2u /* u16 */
#define PVID_HELLO_SETTINGS 4u /* u32 */
#define PVID_HELLO_SESSION 8u /* u32 */
#define PVID_HELLO_BOARD 12u /* char[16] */
#define PVID_HELLO_BYTES 28u

#define PVID_SCHEMA 2u
#define PVID_SCHEMA_TEXT 0u /* char[] */
#define PVID_SCHEMA_BYTES 0u

#define PVID_CONFIGURE 3u
#define PVID_CONFIGURE_SESSION 0u /* u32 */
#define PVID_CONFIGURE_SETTINGS 4u /* u32 */
#define PVID_CONFIGURE_FORM 8u /* u8 */
#define PVID_CONFIGURE_LAW 9u /* u8 */
#define PVID_CONFIGURE_DIVIDER 10u /* u16 */
#define PVID_CONFIGURE_HASH_EVERY 12u /* u16 */
#define PVID_CONFIGURE_ESTIMATE_EVERY 14u /* u16 */
#define PVID_CONFIGURE_START 16u /* f32[6] */
#define PVID_CONFIGURE_START_SD 40u /* f32[6] */
#define PVID_CONFIGURE_LOWER 64u /* f32[6] */
#define PVID_CONFIGURE_UPPER 88u /* f32[6] */
#define PVID_CONFIGURE_ROW_SD 112u /* f32 */
#define PVID_CONFIGURE_FORGETTING_S 116u /* f32 */
#define PVID_CONFIGURE_FEEDBACK_HZ 120u /* f32 */
#define PVID_CONFIGURE_BYTES 124u

#define PVID_SAMPLE 4u
#define PVID_SAMPLE_PHI_Y 0u /* f32[] */
#define PVID_SAMPLE_BYTES 0u

#define PVID_RAW 5u
#define PVID_RAW_PHI_Y 0u /* f32[] */
#define PVID_RAW_BYTES 0u

#define PVID_ESTIMATE 6u
#define PVID_ESTIMATE_SESSION 0u /* u32 */
#define PVID_ESTIMATE_UPDATES 4u /* u32 */
#define PVID_ESTIMATE_P 8u /* f32[6] */
#define PVID_ESTIMATE_COVARIANCE 32u /* f32[21] */
#define PVID_ESTIMATE_KAPPA 116u /* f32 */
#define PVID_ESTIMATE_RESIDUAL_SD 120u /* f32 */
#define PVID_ESTIMATE_WEIGHT 124u /* f32 */
#define PVID_ESTIMATE_REASON 128u /* u8 */
#define PVID_ESTIMATE_BYTES 129u

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
#define PVID_STATUS_BYTES 38u

#define PVID_HASH 8u
#define PVID_HASH_SESSION 0u /* u32 */
#define PVID_HASH_HASH 4u /* u32 */
#define PVID_HASH_BYTES 8u

#define PVID_CREDIT 9u
#define PVID_CREDIT_SESSION 0u /* u32 */
#define PVID_CREDIT_ROOM 4u /* u32 */
#define PVID_CREDIT_HASH 8u /* u32 */
#define PVID_CREDIT_REASON 12u /* u8 */
#define PVID_CREDIT_BYTES 13u

/* Status.code */
#define PVID_CODE_WAITING 0u
#define PVID_CODE_RUNNING 1u
#define PVID_CODE_REFUSED_BY_CORE 2u
#define PVID_CODE_REFUSED_SETTINGS 3u
#define PVID_CODE_REFUSED_FORM 4u
#define PVID_CODE_ARITHMETIC 5u

/* Hello.form */
#define PVID_FORM_STRONG 0u
#define PVID_FORM_WEAK 1u

#endif
