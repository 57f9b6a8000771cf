/* Replaces, for static analysis, the stream_tables.h of an image: declares its settings. */
#ifndef STREAM_TABLES_H
#define STREAM_TABLES_H

#include "pvid/weak.h"
#include "pvid/pvid.h"
#include "pvid/pvid_q31.h"
#include "stream_rig.h"

#if STREAM_FORM == 2 /* the name of the object */
extern const pvid_weak_config_f32 STREAM_CONFIG;
#else
extern const STREAM_CONFIG stream_config;
#endif

#endif
