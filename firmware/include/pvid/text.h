/* pvid/text.h - the outcome of a tick and the answer of an init in words, for a log or a terminal.
 *
 *   printf("%s\n", pvid_reason_text(pvid_weak_step_f32(&identifier, sample)));      "held not excited"
 *   printf("%s\n", pvid_status_text(pvid_weak_init_f32(&identifier, &config)));     "bad row sd: not finite or ..."
 *
 * The texts take 3 kB of flash in an image that calls these functions, and nothing in others. With PVID_TEXTS 0 both
 * return "" and the texts are left out; this is the default on an AVR, which would copy them to RAM.
 */
#ifndef PVID_TEXT_H
#define PVID_TEXT_H

#include "pvid/config.h"
#include "pvid/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The name of a reason in words, as the host prints it; "unknown reason" for any other number. Never NULL; constant. */
const char *pvid_reason_text(pvid_reason reason);

/* The name of a status in words and, behind a colon, what the field must be; "unknown status" for any other number.
 * Never NULL; constant. */
const char *pvid_status_text(pvid_status status);

#ifdef __cplusplus
}
#endif

#endif
