/* pvid/config.h - compile-time bounds of the core.
 *
 * Every array of the library has a size from one of these macros: no heap, no VLA. Override them with -D, or in
 * your own header named by -DPVID_CONFIG_HEADER="my.h". Sizes determine the layout of the state
 * structs: init refuses an application compiled with other sizes than the library (layout.h). The CMake target passes
 * its sizes on to its users.
 */
#ifndef PVID_CONFIG_H
#define PVID_CONFIG_H

#ifdef PVID_CONFIG_HEADER
#include PVID_CONFIG_HEADER
#endif

/* Longest window of a differentiator [samples]: 2 * half * stride + 1. RAM: 4 bytes each, in each. */
#ifndef PVID_MAX_WINDOW
#define PVID_MAX_WINDOW 321
#endif
#if PVID_MAX_WINDOW < 5 || PVID_MAX_WINDOW > 8191
#error "PVID_MAX_WINDOW must lie in 5..8191"
#endif

/* Largest number of entries of theta. */
#ifndef PVID_MAX_THETA
#define PVID_MAX_THETA 11
#endif
#if PVID_MAX_THETA < 1 || PVID_MAX_THETA > 32
#error "PVID_MAX_THETA must lie in 1..32"
#endif

/* Largest number of free parameters p. */
#ifndef PVID_MAX_P
#define PVID_MAX_P 4
#endif
#if PVID_MAX_P < 3 || PVID_MAX_P > 16
#error "PVID_MAX_P must lie in 3..16"
#endif

/* Largest number of constraints between parameters (model.h); 0 leaves them out. */
#ifndef PVID_MAX_CONSTRAINTS
#define PVID_MAX_CONSTRAINTS 0
#endif
#if PVID_MAX_CONSTRAINTS < 0 || PVID_MAX_CONSTRAINTS > 8
#error "PVID_MAX_CONSTRAINTS must lie in 0..8"
#endif

/* Largest number of directions along which parameters drift (model.h); 0 leaves them out. */
#ifndef PVID_MAX_DRIFTS
#define PVID_MAX_DRIFTS 0
#endif
#if PVID_MAX_DRIFTS < 0 || PVID_MAX_DRIFTS > 4
#error "PVID_MAX_DRIFTS must lie in 0..4"
#endif

/* Largest number of entries of M, the sum of n (n + 1) / 2 over the kinds of rows, of n theta each. RAM: 12
 * bytes each. */
#ifndef PVID_MAX_MOMENTS
#define PVID_MAX_MOMENTS 45
#endif
#if PVID_MAX_MOMENTS < 1 || PVID_MAX_MOMENTS > 528
#error "PVID_MAX_MOMENTS must lie in 1..528"
#endif

/* Largest decimation of the weak form's front end [ticks a step]. No array depends on it. */
#ifndef PVID_MAX_DECIMATION
#define PVID_MAX_DECIMATION 32
#endif
#if PVID_MAX_DECIMATION < 1 || PVID_MAX_DECIMATION > 255
#error "PVID_MAX_DECIMATION must lie in 1..255"
#endif

/* Largest number of test functions. RAM: see PVID_MAX_COLUMNS. */
#ifndef PVID_MAX_FUNCTIONS
#define PVID_MAX_FUNCTIONS 16
#endif
#if PVID_MAX_FUNCTIONS < 4 || PVID_MAX_FUNCTIONS > 64
#error "PVID_MAX_FUNCTIONS must lie in 4..64"
#endif

/* Largest number of Gauss-Newton steps per window of the weak form. */
#ifndef PVID_MAX_ITERATIONS
#define PVID_MAX_ITERATIONS 10
#endif
#if PVID_MAX_ITERATIONS < 1 || PVID_MAX_ITERATIONS > 255
#error "PVID_MAX_ITERATIONS must lie in 1..255"
#endif

/* Largest number of entries of theta in the fixed-point core. */
#ifndef PVID_MAX_THETA_Q31
#define PVID_MAX_THETA_Q31 11
#endif
#if PVID_MAX_THETA_Q31 < 5 || PVID_MAX_THETA_Q31 > 31
#error "PVID_MAX_THETA_Q31 must lie in 5..31"
#endif

/* Largest number of entries of M in the fixed-point core: the sum of n (n + 1) / 2 over the kinds of rows, of n theta
 * each. RAM: 12 bytes each. */
#ifndef PVID_MAX_MOMENTS_Q31
#define PVID_MAX_MOMENTS_Q31 66
#endif
#if PVID_MAX_MOMENTS_Q31 < 1 || PVID_MAX_MOMENTS_Q31 > 496
#error "PVID_MAX_MOMENTS_Q31 must lie in 1..496"
#endif

/* Largest number of non-zeros of d theta / d p in the fixed-point core. RAM: 6 bytes each. */
#ifndef PVID_MAX_C_Q31
#define PVID_MAX_C_Q31 22
#endif
#if PVID_MAX_C_Q31 < 1 || PVID_MAX_C_Q31 > 248
#error "PVID_MAX_C_Q31 must lie in 1..248"
#endif

/* Qualifier of the fixed-point tables; empty where flash is addressed like RAM. On an AVR __flash (with
 * -std=gnu99) keeps the tables in the first 64 kB of the flash instead of copying them to RAM. */
#ifndef PVID_TABLE
#define PVID_TABLE
#endif

/* 0 leaves the texts of pvid/text.h out. */
#ifndef PVID_TEXTS
#if defined(__AVR__)
#define PVID_TEXTS 0
#else
#define PVID_TEXTS 1
#endif
#endif
#if PVID_TEXTS != 0 && PVID_TEXTS != 1
#error "PVID_TEXTS must be 0 or 1"
#endif

/* ---- sizes of pvid/weak.h ---- */

/* Most samples of a tick. */
#ifndef PVID_MAX_SAMPLES
#define PVID_MAX_SAMPLES 8
#endif
#if PVID_MAX_SAMPLES < 1 || PVID_MAX_SAMPLES > 32
#error "PVID_MAX_SAMPLES must lie in 1..32"
#endif

/* Numbers in the front end's line: signals times (4 half + 5), with the half of the longest compensator [steps]. RAM:
 * 4 bytes each. */
#ifndef PVID_MAX_RING
#define PVID_MAX_RING 256
#endif
#if PVID_MAX_RING < 8 || PVID_MAX_RING > 8192
#error "PVID_MAX_RING must lie in 8..8192"
#endif

/* Most jets, runs and signs together. */
#ifndef PVID_MAX_INPUTS
#define PVID_MAX_INPUTS 16
#endif
#if PVID_MAX_INPUTS < 1 || PVID_MAX_INPUTS > 32
#error "PVID_MAX_INPUTS must lie in 1..32"
#endif

/* Most channels that are summed, and most gains. RAM: 24 bytes each and 24 for each harmonic. */
#ifndef PVID_MAX_CHANNELS
#define PVID_MAX_CHANNELS 14
#endif
#if PVID_MAX_CHANNELS < 1 || PVID_MAX_CHANNELS > 64
#error "PVID_MAX_CHANNELS must lie in 1..64"
#endif

/* Most integrands; most runs; most signs. RAM: 48 bytes each. */
#ifndef PVID_MAX_INTEGRANDS
#define PVID_MAX_INTEGRANDS 3
#endif
#if PVID_MAX_INTEGRANDS < 1 || PVID_MAX_INTEGRANDS > 32
#error "PVID_MAX_INTEGRANDS must lie in 1..32"
#endif

/* Most harmonics of a window's sums, K/2 + n/2 + 1. */
#ifndef PVID_MAX_HARMONICS
#define PVID_MAX_HARMONICS 13
#endif
#if PVID_MAX_HARMONICS < 4 || PVID_MAX_HARMONICS > 40
#error "PVID_MAX_HARMONICS must lie in 4..40"
#endif

/* Most kinds of rows: equations of a mechanism. */
#ifndef PVID_MAX_KINDS
#define PVID_MAX_KINDS 3
#endif
#if PVID_MAX_KINDS < 1 || PVID_MAX_KINDS > 8
#error "PVID_MAX_KINDS must lie in 1..8"
#endif

/* Most columns of a kind: theta's, Y and nuisances. RAM: 4 bytes for each column and function. */
#ifndef PVID_MAX_COLUMNS
#define PVID_MAX_COLUMNS 12
#endif
#if PVID_MAX_COLUMNS < 2 || PVID_MAX_COLUMNS > 48
#error "PVID_MAX_COLUMNS must lie in 2..48"
#endif

/* Largest n of the test functions sin^n. RAM: 4 bytes for each power and harmonic. */
#ifndef PVID_MAX_POWER
#define PVID_MAX_POWER 8
#endif
#if PVID_MAX_POWER < 2 || PVID_MAX_POWER > 12
#error "PVID_MAX_POWER must lie in 2..12"
#endif

/* Blocks of steps in the sums. 2: one fills while the other is added. 1 suffices where the ticks of one step add and
 * join a whole block; `pvid model build` prints the number. RAM: 32 bytes for each block and channel, 16 in the
 * fixed-point core. init refuses a design that needs 2 if it is 1. */
#ifndef PVID_MAX_BLOCKS
#define PVID_MAX_BLOCKS 2
#endif
#if PVID_MAX_BLOCKS < 1 || PVID_MAX_BLOCKS > 2
#error "PVID_MAX_BLOCKS must lie in 1..2"
#endif

/* Windows whose sums have memory of their own: 1 or 0. 0 suffices where all columns of a window are formed before the
 * first block of the next half is added: the sums then overwrite those of the older half. `pvid model build` prints the
 * number. RAM: 8 bytes for each channel and harmonic. init refuses a design that needs 1 if it is 0. */
#ifndef PVID_MAX_WINDOWS
#define PVID_MAX_WINDOWS 1
#endif
#if PVID_MAX_WINDOWS < 0 || PVID_MAX_WINDOWS > 1
#error "PVID_MAX_WINDOWS must lie in 0..1"
#endif

/* 1: a build for one model and one design of the weak form. The sizes must be exactly those that `pvid model build`
 * prints with the design; init refuses any other design (PVID_BAD_DESIGN). Loops have a constant length: fewer
 * instructions, more flash, the same bits. */
#ifndef PVID_EXACT
#define PVID_EXACT 0
#endif
#if PVID_EXACT < 0 || PVID_EXACT > 1
#error "PVID_EXACT must be 0 or 1"
#endif
#if !PVID_EXACT /* counts of the model that no array has as its size */
#define PVID_EXACT_SIGNALS 0
#define PVID_EXACT_JETS 0
#define PVID_EXACT_RUNS 0
#define PVID_EXACT_SIGNS 0
#define PVID_EXACT_GAINS 0
#define PVID_EXACT_INTEGRANDS 0
#define PVID_EXACT_CHANNELS 0 /* that are summed */
#endif
#ifndef PVID_EXACT_PLAIN /* 1: the signals are the samples; of the float core */
#define PVID_EXACT_PLAIN 0
#endif

/* Parts that a design or its settings may not need; 0 leaves a part out, for less flash. `pvid model build` prints
 * them. init refuses settings that need a part that is left out: a dead zone with PVID_BAD_DEAD_ZONE, gamma < 1 with
 * PVID_BAD_FEEDBACK, shared errors with PVID_BAD_SHARED, a second stage with PVID_BAD_POINTER. */
#ifndef PVID_DEAD_ZONE /* dead zone of estimator.h */
#define PVID_DEAD_ZONE 1
#endif
#if PVID_DEAD_ZONE != 0 && PVID_DEAD_ZONE != 1
#error "PVID_DEAD_ZONE must be 0 or 1"
#endif
#ifndef PVID_FEEDBACK /* laws of the weak form with gamma < 1 (estimator.h) */
#define PVID_FEEDBACK 1
#endif
#if PVID_FEEDBACK != 0 && PVID_FEEDBACK != 1
#error "PVID_FEEDBACK must be 0 or 1"
#endif
#ifndef PVID_SHARED /* errors that all windows share (trust.h) */
#define PVID_SHARED 1
#endif
#if PVID_SHARED != 0 && PVID_SHARED != 1
#error "PVID_SHARED must be 0 or 1"
#endif
#ifndef PVID_REFINEMENT /* second stage of weak.h */
#define PVID_REFINEMENT 1
#endif
#if PVID_REFINEMENT != 0 && PVID_REFINEMENT != 1
#error "PVID_REFINEMENT must be 0 or 1"
#endif
/* init checks every number of a float model and design. 0: only the counts, for unchanged tables of `pvid model build`,
 * which has checked them. */
#ifndef PVID_CHECK_TABLES
#define PVID_CHECK_TABLES 1
#endif
#if PVID_CHECK_TABLES != 0 && PVID_CHECK_TABLES != 1
#error "PVID_CHECK_TABLES must be 0 or 1"
#endif

/* Called with a false condition on misuse: NULL instead of an object, or an object before its init. Define your
 * own trap or reset here; by default the misused function does nothing and returns PVID_NOT_READY or
 * PVID_BAD_POINTER. */
#ifndef PVID_ASSERT
#define PVID_ASSERT(condition) ((void)(condition))
#endif

/* ---- fixed sizes ---- */

#define PVID_ORDERS 5        /* derivatives of a channel: orders 0 to 4 */
#define PVID_TRUST_SHORT 8   /* groups in the alarm's short mean; see trust.h */
#define PVID_TRUST_LONG 16   /* least number of groups in its long mean */
#define PVID_READ_ATTEMPTS 8 /* attempts of a read; one fails only during a put */

/* The promised bits need IEEE-754 binary32: no excess precision, no fast-math. */
#if defined(__FAST_MATH__)
#error "pvid must be compiled without -ffast-math: its results would not be reproducible"
#endif
#if defined(__FLT_EVAL_METHOD__) && __FLT_EVAL_METHOD__ != 0 && __FLT_EVAL_METHOD__ != 16
#error "pvid needs float arithmetic without excess precision (on x87: -msse2 -mfpmath=sse)"
#endif

#endif
