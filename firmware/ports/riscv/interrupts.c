/* The UART's interrupt is source PVID_UART_IRQ of the platform's controller (PLIC) of QEMU's `virt`. It is masked
 * at the core (mie), because the controller ignores the completion of a masked source. */
#include "../interrupts.h"

#include <stdint.h>

#include "../uart/uart.h"

#define PLIC(offset) (*(volatile uint32_t *)(uintptr_t)(0x0C000000u + (offset)))
#define PRIORITY PLIC(4u * PVID_UART_IRQ)
#define ENABLE PLIC(0x2000u + (4u * (PVID_UART_IRQ / 32u)))
#define THRESHOLD PLIC(0x200000u)
#define CLAIM PLIC(0x200004u)

#define CSR(text) __asm__ volatile(".option push\n\t.option arch, +zicsr\n\t" text "\n\t.option pop" ::: "t0", "memory")

void pvid_external_interrupt(void);
void pvid_trap_vectors(void);

__attribute__((interrupt("machine"))) void pvid_external_interrupt(void)
{
    const uint32_t source = CLAIM;
    if (source == PVID_UART_IRQ) {
        pvid_uart_interrupt();
    }
    CLAIM = source;
}

/* By cause: 0, where exceptions go too, to 10 are faults; 11 is the machine's external interrupt. */
__attribute__((naked, aligned(64))) void pvid_trap_vectors(void)
{
    __asm__ volatile(".option push\n\t"
                     ".option norvc\n\t"
                     ".rept 11\n\t"
                     "j pvid_trap\n\t"
                     ".endr\n\t"
                     "j pvid_external_interrupt\n\t"
                     ".option pop");
}

void pvid_interrupts_uart(bool on)
{
    if (on) {
        CSR("li t0, 0x800\n\tcsrs mie, t0");
    } else {
        CSR("li t0, 0x800\n\tcsrc mie, t0");
    }
}

void pvid_interrupts_init(void)
{
    PRIORITY = 1u;
    ENABLE = (uint32_t)1u << (PVID_UART_IRQ % 32u);
    THRESHOLD = 0u;
    CSR("la t0, pvid_trap_vectors + 1\n\tcsrw mtvec, t0"); /* 1: vectored */
    pvid_interrupts_uart(true);
    pvid_interrupts_unmask();
}

void pvid_interrupts_mask(void)
{
    CSR("csrci mstatus, 8");
}

void pvid_interrupts_unmask(void)
{
    CSR("csrsi mstatus, 8");
}

void pvid_interrupts_wait(void)
{
    __asm__ volatile("wfi" ::: "memory");
}
