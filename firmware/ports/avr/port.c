/* An ATmega with USART0 and timer 1 (328P, 2560, ...), started by avr-libc.
 *
 * Counts are clock cycles. The stack grows down from the end of the RAM towards .bss; the space between is
 * painted. There is no protection against overflow.
 */
#include "../port.h"

#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <stdlib.h>
#include <util/delay.h>

#include "../fault.h"

#define PAINT 0xC5

extern uint8_t __heap_start; /* the first byte behind .bss */
extern uint8_t __stack;      /* the last byte of the RAM */

static volatile uint16_t overflows; /* of timer 1 */

/* A part of the start-up sequence: it runs into the next one, before anything is on the stack. 0xC5: PAINT. */
__asm__(".section .init3,\"ax\",@progbits\n\t"
        "ldi r30, lo8(__heap_start)\n\t"
        "ldi r31, hi8(__heap_start)\n\t"
        "ldi r24, 0xC5\n\t"
        "ldi r25, hi8(__stack + 1)\n"
        "1:\tst Z+, r24\n\t"
        "cpi r30, lo8(__stack + 1)\n\t"
        "cpc r31, r25\n\t"
        "brne 1b\n\t"
        ".text");

ISR(TIMER1_OVF_vect)
{
    overflows++;
}

/* avr-libc's start calls this when main returns. */
void exit(int code)
{
    pvid_port_exit(code);
}

ISR(BADISR_vect)
{
    pvid_fault_begin("interrupt without a handler");
    pvid_fault_end();
}

void pvid_port_init(void)
{
    UBRR0 = (F_CPU / 8u / 115200u) - 1u;
    UCSR0A = (uint8_t)_BV(U2X0);
    UCSR0C = (uint8_t)(_BV(UCSZ01) | _BV(UCSZ00));
    UCSR0B = (uint8_t)(_BV(RXEN0) | _BV(TXEN0));
    TCCR1A = 0u;
    TCCR1B = (uint8_t)_BV(CS10);
    TIMSK1 = (uint8_t)_BV(TOIE1);
    sei();
}

size_t pvid_port_receive(uint8_t bytes[], size_t room)
{
    size_t n = 0;
    while ((n < room) && ((UCSR0A & _BV(RXC0)) != 0)) {
        bytes[n] = UDR0;
        n++;
    }
    return n;
}

size_t pvid_port_send(const uint8_t bytes[], size_t n)
{
    size_t taken = 0;
    while ((taken < n) && ((UCSR0A & _BV(UDRE0)) != 0)) {
        UDR0 = bytes[taken];
        taken++;
    }
    return taken;
}

uint32_t pvid_port_instructions(void)
{
    const uint8_t status = SREG;
    cli();
    const uint16_t low = TCNT1;
    uint16_t high = overflows;
    if (((TIFR1 & _BV(TOV1)) != 0) && (low < 0x8000u)) { /* wrapped, and not counted yet */
        high++;
    }
    SREG = status;
    return ((uint32_t)high << 16) | low;
}

uint32_t pvid_port_counts_per_1024(void)
{
    return 1024u;
}

uint32_t pvid_port_microseconds(void)
{
    static uint32_t value;
    static uint32_t rest;
    static uint32_t time;
    const uint32_t now = pvid_port_instructions();
    rest += now - value;
    value = now;
    time += rest / (F_CPU / 1000000u);
    rest %= F_CPU / 1000000u;
    return time;
}

/* Asleep without interrupts, with the code in GPIOR0: the emulator ends. */
void pvid_port_exit(int code)
{
    GPIOR0 = (uint8_t)code;
    _delay_us(200); /* two bytes at 115200 baud: the one on its way and the one behind it */
    cli();
    sleep_enable();
    for (;;) {
        sleep_cpu();
    }
}

size_t pvid_port_stack_size(void)
{
    return ((size_t)&__stack - (size_t)&__heap_start) + 1u;
}

size_t pvid_port_stack_used(void)
{
    const volatile uint8_t *lowest = &__heap_start;
    const size_t size = pvid_port_stack_size();
    size_t painted = 0;
    while ((painted < size) && (lowest[painted] == PAINT)) {
        painted++;
    }
    return size - painted;
}
