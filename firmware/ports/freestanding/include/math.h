/* The part of <math.h> that the core uses, for boards without a C library. */
#ifndef PVID_FREESTANDING_MATH_H
#define PVID_FREESTANDING_MATH_H

/* Correctly rounded, to nearest even, as IEEE 754 asks. With an FPU the compiler writes its instruction. */
float sqrtf(float x);

#endif
