/* Three parameters, of which the equation is linear in each. */
#define PVID_MAX_THETA 3
#define PVID_MAX_P 3
#define PVID_MAX_MOMENTS 6
