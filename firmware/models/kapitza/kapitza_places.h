/* Places of the strong form's 57 sums of products and their weight, in either arithmetic. G is u, or w + u; families
 * descend in its powers. */
#ifndef PVID_KAPITZA_PLACES_H
#define PVID_KAPITZA_PLACES_H

enum {
    PVID_SUM_AA = 0,
    PVID_SUM_AE = 1,
    PVID_SUM_EE = 2,
    PVID_SUM_YA = 3,
    PVID_SUM_YE = 4,
    PVID_SUM_YY = 5,
    PVID_SUM_A2 = 6,     /* 4: A (-G^k phi'') */
    PVID_SUM_E2 = 10,    /* 4 */
    PVID_SUM_Y2 = 14,    /* 4 */
    PVID_SUM_A0 = 18,    /* 5: A (-G^k phi) */
    PVID_SUM_E0 = 23,    /* 5 */
    PVID_SUM_Y0 = 28,    /* 5 */
    PVID_SUM_K22 = 33,   /* 7: phi''^2 G^k */
    PVID_SUM_K20 = 40,   /* 8: phi'' phi G^k */
    PVID_SUM_K00 = 48,   /* 9: phi^2 G^k */
    PVID_SUM_WEIGHT = 57 /* of rows */
};

#endif
