/* pvid/kapitza_parameters.h - indices and numbers of the pendulum's parameters, for both cores of the
 * strong form. Meaning: kapitza.h. */
#ifndef PVID_KAPITZA_PARAMETERS_H
#define PVID_KAPITZA_PARAMETERS_H

#include "pvid/config.h"

#define PVID_KAPITZA_P 3
#define PVID_KAPITZA_STRONG_THETA 11

enum { PVID_KAPITZA_W = 0, PVID_KAPITZA_D1 = 1, PVID_KAPITZA_D2 = 2 };

#endif
