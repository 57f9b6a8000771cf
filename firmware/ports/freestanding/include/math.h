/* The part of <math.h> that the core uses, for boards without a C library. */
#ifndef PVID_FREESTANDING_MATH_H
#define PVID_FREESTANDING_MATH_H

/* Correctly rounded, to nearest even, as IEEE 754 requires. With an FPU the compiler emits its instruction. */
float sqrtf(float x);

#endif
