/* Stands for the stream_tables.h of an image: settings that are somewhere else. */
#ifndef STREAM_TABLES_H
#define STREAM_TABLES_H

#include "pvid/pvid.h"
#include "pvid/pvid_q31.h"

#if (STREAM_CORE == 1) && (STREAM_FORM == 1)
extern const pvid_weak_config_q31 stream_config;
#elif STREAM_CORE == 1
extern const pvid_strong_config_q31 stream_config;
#elif STREAM_FORM == 1
extern const pvid_weak_config_f32 stream_config;
#else
extern const pvid_strong_config_f32 stream_config;
#endif

#endif
