/* pvid/mechanism_q31.h - mechanism.h in integers alone. */
#ifndef PVID_MECHANISM_Q31_H
#define PVID_MECHANISM_Q31_H

#include "pvid/kapitza_q31.h"
#include "pvid/kapitza_strong_q31.h"

#endif
