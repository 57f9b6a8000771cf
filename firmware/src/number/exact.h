/* Counts that are constants in a build for one model and design (PVID_EXACT of pvid/config.h), so that the compiler
 * writes loops over them out. Private to the core. Changes no result. */
#ifndef PVID_EXACT_H
#define PVID_EXACT_H

#include <stddef.h>

#include "number/unroll.h"
#include "pvid/config.h"

/* `count` of a model or design, which is `size` in such a build. */
#define PVID_COUNT(size, count) ((PVID_EXACT != 0) ? (size_t)(size) : (size_t)(count))

/* Before a loop over such a count. */
#if PVID_EXACT == 1
#define PVID_UNROLL_EXACT PVID_UNROLL
#else
#define PVID_UNROLL_EXACT
#endif

#endif
