#include "pvid/layout.h"

uint32_t pvid_layout(void)
{
    return PVID_LAYOUT;
}

const char *pvid_layout_sizes(void)
{
#if PVID_TEXTS
    return PVID_LAYOUT_SIZES;
#else
    return "";
#endif
}
