#include "number/uncontracted.h"

#include "number/finite_f32.h"

#include "number/unroll.h"

PVID_COLD bool pvid_within_f32(float x, float low, float high)
{
    return pvid_finite_f32(x) && (x >= low) && (x <= high);
}
