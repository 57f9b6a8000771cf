/* pvid/layout.h - the sizes that library and application must share, as one word that every init compares.
 *
 * Sizes (config.h) determine the layout of the structs. An application compiled with other sizes than the library
 * provides objects that are too small, and the library would write beyond their end. So the init of an object whose
 * struct depends on sizes is an inline function, compiled into the application: it gives the library the application's
 * word, PVID_LAYOUT. If it differs from the library's, init returns PVID_BAD_LAYOUT and writes nothing: a static object
 * stays all zeros, which is not ready. Nobody writes the word by hand, and no object or table contains it.
 *
 *   if (pvid_weak_init_f32(&identifier, &config) == PVID_BAD_LAYOUT) {
 *       printf("library: %s\napplication: %s\n", pvid_layout_sizes(), PVID_LAYOUT_SIZES);
 *   }
 *
 * Solution: set the sizes in one place for the library's sources and yours: a header of yours named by
 * -DPVID_CONFIG_HEADER, the CMake options, or the same -D for all files. Other languages call pvid_weak_init_layout_f32
 * and its like with the word of the headers that they read.
 */
#ifndef PVID_LAYOUT_H
#define PVID_LAYOUT_H

#include <stdint.h>

#include "pvid/config.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Sizes of enumerations differ between compilers for ARM (-fshort-enums). */
#if defined(__ARM_SIZEOF_MINIMAL_ENUM)
#define PVID_ENUM_SIZE __ARM_SIZEOF_MINIMAL_ENUM
#else
#define PVID_ENUM_SIZE 0
#endif

/* Every macro that a struct depends on, and its factor in the word: powers of the prime of FNV-1a modulo 2^32. They are
 * odd, so that another value of one macro always gives another word. */
#define PVID_LAYOUT_OF(SIZE)                                                                                           \
    SIZE("window", PVID_MAX_WINDOW, 16777619u)                                                                         \
    SIZE("theta", PVID_MAX_THETA, 637696617u)                                                                          \
    SIZE("p", PVID_MAX_P, 1055306571u)                                                                                 \
    SIZE("constraints", PVID_MAX_CONSTRAINTS, 2166136261u)                                                             \
    SIZE("drifts", PVID_MAX_DRIFTS, 84696351u)                                                                         \
    SIZE("moments", PVID_MAX_MOMENTS, 1345077009u)                                                                     \
    SIZE("decimation", PVID_MAX_DECIMATION, 1185368003u)                                                               \
    SIZE("functions", PVID_MAX_FUNCTIONS, 4233492473u)                                                                 \
    SIZE("iterations", PVID_MAX_ITERATIONS, 878009595u)                                                                \
    SIZE("theta_q31", PVID_MAX_THETA_Q31, 1566662433u)                                                                 \
    SIZE("moments_q31", PVID_MAX_MOMENTS_Q31, 558416115u)                                                              \
    SIZE("c_q31", PVID_MAX_C_Q31, 1485291145u)                                                                         \
    SIZE("samples", PVID_MAX_SAMPLES, 3870355883u)                                                                     \
    SIZE("ring", PVID_MAX_RING, 3549196337u)                                                                           \
    SIZE("inputs", PVID_MAX_INPUTS, 924097827u)                                                                        \
    SIZE("channels", PVID_MAX_CHANNELS, 3631439385u)                                                                   \
    SIZE("integrands", PVID_MAX_INTEGRANDS, 3600621915u)                                                               \
    SIZE("harmonics", PVID_MAX_HARMONICS, 878412353u)                                                                  \
    SIZE("kinds", PVID_MAX_KINDS, 2903379027u)                                                                         \
    SIZE("columns", PVID_MAX_COLUMNS, 3223152297u)                                                                     \
    SIZE("power", PVID_MAX_POWER, 390634507u)                                                                          \
    SIZE("blocks", PVID_MAX_BLOCKS, 2991433041u)                                                                       \
    SIZE("windows", PVID_MAX_WINDOWS, 20659843u)                                                                       \
    SIZE("feedback", PVID_FEEDBACK, 1933797433u)                                                                       \
    SIZE("exact", PVID_EXACT, 2887586235u)                                                                             \
    SIZE("exact_plain", PVID_EXACT_PLAIN, 2898454881u)                                                                 \
    SIZE("exact_runs", PVID_EXACT_RUNS, 1473602483u)                                                                   \
    SIZE("exact_signs", PVID_EXACT_SIGNS, 4159435465u)                                                                 \
    SIZE("exact_gains", PVID_EXACT_GAINS, 292500075u)                                                                  \
    SIZE("exact_integrands", PVID_EXACT_INTEGRANDS, 3708575345u)                                                       \
    SIZE("enum_size", PVID_ENUM_SIZE, 1803070435u)

/* The application's word. */
#define PVID_LAYOUT_TERM(name, value, factor) +((uint64_t)(value) * (factor))
#define PVID_LAYOUT ((uint32_t)(((uint64_t)2166136261u PVID_LAYOUT_OF(PVID_LAYOUT_TERM)) & 0xFFFFFFFFu))

/* The application's sizes in words: "window=321 theta=11 ...". */
#define PVID_LAYOUT_TEXT_OF(value) #value
#define PVID_LAYOUT_TEXT(name, value, factor) name "=" PVID_LAYOUT_TEXT_OF(value) " "
#define PVID_LAYOUT_SIZES PVID_LAYOUT_OF(PVID_LAYOUT_TEXT)

/* The library's word and sizes; the text is "" with PVID_TEXTS 0. */
uint32_t pvid_layout(void);
const char *pvid_layout_sizes(void);

#ifdef __cplusplus
}
#endif

#endif
