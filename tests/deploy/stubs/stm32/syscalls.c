/* Stands in for syscalls.c and sysmem.c of STM32CubeMX: what newlib-nano's puts calls. */
#include <stddef.h>
#include <stdint.h>
#include <sys/stat.h>

#include "port.h"

int _write(int file, const char *text, int length)
{
    (void)file;
    for (int k = 0; k < length; k++) {
        while (pvid_port_send((const uint8_t *)&text[k], 1) == 0u) {
        }
    }
    return length;
}

void *_sbrk(ptrdiff_t more)
{
    static uint8_t heap[2048];
    static size_t used;
    if (more > (ptrdiff_t)(sizeof heap - used)) {
        return (void *)-1;
    }
    used += (size_t)more;
    return &heap[used - (size_t)more];
}

int _fstat(int file, struct stat *state)
{
    (void)file;
    state->st_mode = S_IFCHR;
    return 0;
}

int _isatty(int file)
{
    (void)file;
    return 1;
}

int _close(int file)
{
    (void)file;
    return -1;
}

int _lseek(int file, int offset, int from)
{
    (void)file;
    (void)offset;
    (void)from;
    return 0;
}

int _read(int file, char *text, int length)
{
    (void)file;
    (void)text;
    (void)length;
    return 0;
}
