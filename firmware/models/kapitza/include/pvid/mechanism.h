/* pvid/mechanism.h - the mechanism that this build is for (the CMake variable PVID_MODEL): Kapitza's pendulum. */
#ifndef PVID_MECHANISM_H
#define PVID_MECHANISM_H

#include "pvid/kapitza.h"

#endif
