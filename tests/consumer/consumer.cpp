// The headers from C++, each by itself and before the others, and the C library behind them.
// Prints "version MAJOR.MINOR.PATCH harmonics PVID_MAX_HARMONICS".
#include "pvid/weak.h"

#include "pvid/weak_q31.h"

#include "pvid/fnv.h"

#include "pvid/arithmetic.h"

#include "pvid/pvid.h"
#include "pvid/pvid_q31.h"

#include <cstdio>

namespace
{

pvid_weak_f32 weak;
pvid_weak_q31 weak_integers;

} // namespace

int main()
{
    // Linking is half of the test: without C linkage these are other names than the library's. Empty configurations
    // are refused.
    pvid_weak_config_f32 weak_config{};
    weak_config.estimator = pvid_estimator_defaults_f32;
    const pvid_weak_config_q31 weak_config_q31{};
    if (pvid_weak_init_q31(&weak_integers, &weak_config_q31) == PVID_OK ||
        pvid_weak_init_f32(&weak, &weak_config) == PVID_OK || pvid_arithmetic_faults_f32() != 0) {
        return 1;
    }
    std::printf("version %d.%d.%d harmonics %d\n", PVID_VERSION_MAJOR, PVID_VERSION_MINOR, PVID_VERSION_PATCH,
                PVID_MAX_HARMONICS);
    return 0;
}
