/* What a compiler may call even without a C library. Compiled so that these loops do not become calls of
 * themselves (-fno-tree-loop-distribute-patterns). */
#include <stdint.h>
#include <string.h>

#define WORD_ALIGNED(address) (((uintptr_t)(address) % sizeof(uint32_t)) == 0u)

void *memcpy(void *restrict to, const void *restrict from, size_t n)
{
    uint8_t *restrict target = to;
    const uint8_t *restrict source = from;
    if (WORD_ALIGNED(to) && WORD_ALIGNED(from)) {
        uint32_t *restrict word_target = to;
        const uint32_t *restrict word_source = from;
        for (; n >= sizeof(uint32_t); n -= sizeof(uint32_t)) {
            *word_target++ = *word_source++;
        }
        target = (uint8_t *)word_target;
        source = (const uint8_t *)word_source;
    }
    for (; n > 0u; n--) {
        *target++ = *source++;
    }
    return to;
}

void *memmove(void *to, const void *from, size_t n)
{
    uint8_t *target = to;
    const uint8_t *source = from;
    if ((uintptr_t)target < (uintptr_t)source) {
        for (size_t i = 0; i < n; i++) {
            target[i] = source[i];
        }
    } else {
        for (size_t i = n; i > 0u; i--) {
            target[i - 1u] = source[i - 1u];
        }
    }
    return to;
}

void *memset(void *to, int byte, size_t n)
{
    uint8_t *target = to;
    if (WORD_ALIGNED(to)) {
        const uint32_t word = (uint32_t)(uint8_t)byte * 0x01010101u;
        uint32_t *word_target = to;
        for (; n >= sizeof(uint32_t); n -= sizeof(uint32_t)) {
            *word_target++ = word;
        }
        target = (uint8_t *)word_target;
    }
    for (; n > 0u; n--) {
        *target++ = (uint8_t)byte;
    }
    return to;
}

int memcmp(const void *a, const void *b, size_t n)
{
    const uint8_t *left = a;
    const uint8_t *right = b;
    for (size_t i = 0; i < n; i++) {
        if (left[i] != right[i]) {
            return (left[i] < right[i]) ? -1 : 1;
        }
    }
    return 0;
}

size_t strlen(const char *text)
{
    size_t n = 0;
    while (text[n] != '\0') {
        n++;
    }
    return n;
}
