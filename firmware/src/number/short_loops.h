/* Loops over a few numbers stay loops: gcc would call memcpy, memmove or memset, which cost more than the loop. Include
 * it before all others in a file whose arrays are short. */
#ifndef PVID_SHORT_LOOPS_H
#define PVID_SHORT_LOOPS_H

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize("no-tree-loop-distribute-patterns")
#endif

#endif
