/* pvid/version.h - the version, defined here only. Before 1.0 a minor version may change a struct. */
#ifndef PVID_VERSION_H
#define PVID_VERSION_H

#define PVID_VERSION_MAJOR 0
#define PVID_VERSION_MINOR 3
#define PVID_VERSION_PATCH 0

#endif
