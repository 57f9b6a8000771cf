/* Numbers as bytes, low byte first, on any machine. */
#ifndef PVID_LITTLE_ENDIAN_H
#define PVID_LITTLE_ENDIAN_H

#include <stdint.h>
#include <string.h>

/* A type conversion that raises no warning of an old-style cast in C++. */
#if defined(__cplusplus)
#define PVID_AS(type, value) static_cast<type>(value)
#else
#define PVID_AS(type, value) ((type)(value))
#endif

/*@ requires \valid(out + (0 .. 1));
    assigns out[0 .. 1]; */
static inline void pvid_put_u16(uint8_t out[2], uint16_t value)
{
    out[0] = PVID_AS(uint8_t, value & 0xFFu);
    out[1] = PVID_AS(uint8_t, value >> 8);
}

/*@ requires \valid(out + (0 .. 3));
    assigns out[0 .. 3]; */
static inline void pvid_put_u32(uint8_t out[4], uint32_t value)
{
    pvid_put_u16(out, PVID_AS(uint16_t, value & 0xFFFFu));
    pvid_put_u16(&out[2], PVID_AS(uint16_t, value >> 16));
}

static inline uint16_t pvid_get_u16(const uint8_t in[2])
{
    return PVID_AS(uint16_t, in[0] | (PVID_AS(uint16_t, in[1]) << 8));
}

static inline uint32_t pvid_get_u32(const uint8_t in[4])
{
    return pvid_get_u16(in) | (PVID_AS(uint32_t, pvid_get_u16(&in[2])) << 16);
}

static inline void pvid_put_i32(uint8_t out[4], int32_t value)
{
    pvid_put_u32(out, PVID_AS(uint32_t, value));
}

/* A copy, for C99 leaves the conversion of large words to the compiler. */
static inline int32_t pvid_get_i32(const uint8_t in[4])
{
    const uint32_t word = pvid_get_u32(in);
    int32_t value;
    memcpy(&value, &word, sizeof value);
    return value;
}

/* The copy between a float and the word of its bits is the one that C99 defines. */
static inline void pvid_put_f32(uint8_t out[4], float value)
{
    uint32_t word;
    memcpy(&word, &value, sizeof word);
    pvid_put_u32(out, word);
}

static inline float pvid_get_f32(const uint8_t in[4])
{
    const uint32_t word = pvid_get_u32(in);
    float value;
    memcpy(&value, &word, sizeof value);
    return value;
}

#endif
