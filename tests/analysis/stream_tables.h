/* Replaces, for static analysis, the stream_tables.h of an image: declares its settings. */
#ifndef STREAM_TABLES_H
#define STREAM_TABLES_H

#include "pvid/pvid.h"
#include "pvid/pvid_q31.h"
#include "stream_rig.h"

extern const STREAM_CONFIG stream_config;

#endif
