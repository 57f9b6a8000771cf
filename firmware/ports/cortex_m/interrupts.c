/* PVID_UART_IRQ: number of the UART's receive interrupt, from boards/NAME.cmake. */
#include "../interrupts.h"

#include <stdint.h>

#define NVIC_ENABLE ((volatile uint32_t *)(uintptr_t)0xE000E100u)
#define NVIC_DISABLE ((volatile uint32_t *)(uintptr_t)0xE000E180u)

void pvid_interrupts_uart(bool on)
{
    volatile uint32_t *set = on ? NVIC_ENABLE : NVIC_DISABLE;
    set[PVID_UART_IRQ / 32u] = (uint32_t)1u << (PVID_UART_IRQ % 32u);
}

void pvid_interrupts_init(void)
{
    pvid_interrupts_uart(true);
}

void pvid_interrupts_mask(void)
{
    __asm__ volatile("cpsid i" ::: "memory");
}

void pvid_interrupts_unmask(void)
{
    __asm__ volatile("cpsie i\n\tisb" ::: "memory");
}

void pvid_interrupts_wait(void)
{
    __asm__ volatile("dsb\n\twfi" ::: "memory");
}
