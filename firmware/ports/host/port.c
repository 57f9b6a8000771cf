/* The host as a board: its UART is a pseudo-terminal whose name is printed on standard output. It ends with its
 * parent process. */
#define _XOPEN_SOURCE 600

#include <fcntl.h>
#include <poll.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "../port.h"

#define IDLE_MS 1       /* longest wait of receive [ms]: an idle board needs no processor time */
#define IDLE_CALLS 256u /* without a byte either way, after which it does */
#define EXIT_NO_TERMINAL 2

static int line = -1;
static pid_t starter;
static unsigned idle_calls;

void pvid_port_init(void)
{
    struct termios raw;
    starter = getppid();
    line = posix_openpt(O_RDWR | O_NOCTTY);
    if ((line < 0) || (grantpt(line) != 0) || (unlockpt(line) != 0)) {
        perror("no pseudo-terminal");
        exit(EXIT_NO_TERMINAL);
    }
    const char *name = ptsname(line);
    /* Kept open, so that the line does not hang up without a client. */
    const int other_end = open(name, O_RDWR | O_NOCTTY);
    if ((other_end < 0) || (tcgetattr(other_end, &raw) != 0)) {
        perror("no pseudo-terminal");
        exit(EXIT_NO_TERMINAL);
    }
    raw.c_iflag = 0;
    raw.c_oflag = 0;
    raw.c_lflag = 0;
    raw.c_cflag = (raw.c_cflag & ~(tcflag_t)(CSIZE | PARENB)) | CS8;
    (void)tcsetattr(other_end, TCSANOW, &raw);
    (void)fcntl(line, F_SETFL, O_NONBLOCK);
    (void)printf("serial port %s\n", name);
    (void)fflush(stdout);
}

size_t pvid_port_receive(uint8_t bytes[], size_t room)
{
    struct pollfd waiting = {line, POLLIN, 0};
    if (getppid() != starter) {
        exit(0);
    }
    const bool idle = idle_calls >= IDLE_CALLS;
    (void)poll(&waiting, 1, idle ? IDLE_MS : 0);
    const ssize_t n = read(line, bytes, room);
    idle_calls = (n > 0) ? 0u : (idle_calls + (idle ? 0u : 1u));
    return (n > 0) ? (size_t)n : 0u;
}

size_t pvid_port_send(const uint8_t bytes[], size_t n)
{
    const ssize_t taken = (n > 0u) ? write(line, bytes, n) : 0;
    if (taken > 0) {
        idle_calls = 0;
    }
    return (taken > 0) ? (size_t)taken : 0u;
}

uint32_t pvid_port_instructions(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)now.tv_sec * 1000000000u + (uint32_t)now.tv_nsec;
}

uint32_t pvid_port_microseconds(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint32_t)now.tv_sec * 1000000u + (uint32_t)(now.tv_nsec / 1000);
}

/* The host counts nanoseconds and takes one for an instruction. */
uint32_t pvid_port_counts_per_1024(void)
{
    return 1024u;
}

void pvid_port_exit(int code)
{
    exit(code);
}

size_t pvid_port_stack_used(void)
{
    return 0;
}

size_t pvid_port_stack_size(void)
{
    return 0;
}
