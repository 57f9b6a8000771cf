/* What every test program includes first: CMocka, and the headers that it expects before its own. */
#ifndef TEST_H
#define TEST_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

/* One in so many bytes, lengths or draws is tried. The build of gcc for 64 bits tries all: length needs one build. The
 * sanitizers and 32 bits go every way. */
#if defined(__clang__) || !defined(__LP64__)
#define ONE_IN 17u
#else
#define ONE_IN 1u
#endif

/* The program: runs the tests of an array. */
#define RUN(tests)                                                                                                     \
    int main(void)                                                                                                     \
    {                                                                                                                  \
        return cmocka_run_group_tests(tests, NULL, NULL);                                                              \
    }

#endif
