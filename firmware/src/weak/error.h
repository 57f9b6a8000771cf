/* When the variance of an equation's own error follows the residuals. Private to the core. */
#ifndef PVID_WEAK_ERROR_H
#define PVID_WEAK_ERROR_H

#include <stdbool.h>
#include <stddef.h>

#include "pvid/config.h"

/* Whether it does in a mechanism of so many equations: with one alone there are no other rows that its own may spoil,
 * and what its description lacks (a large angle, friction) is no noise. */
static inline bool pvid_weak_error_follows(size_t kinds)
{
    return (PVID_MAX_KINDS > 1) && (kinds > 1u);
}

#endif
