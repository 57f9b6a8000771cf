/* Start of a Cortex-M (v6-M to v8.1-M): vector table, FPU, then main; every exception is a fault, reported over
 * the UART with its cause.
 *
 * A stack overflow faults instead of overwriting variables: the stack is at the lowest address of the RAM, above a
 * guard without write access (v7-M: MPU) or a limit of the stack pointer (v8-M). A v6-M core has only the end of
 * the memory. The report has its own stack.
 */
#include <stdbool.h>

#include "../fault.h"
#include "../memory_map.h"
#include "../start.h"

void pvid_reset(void);
void pvid_exception(void);
void pvid_exception_report(const uint32_t *frame, uint32_t exception);

static uint64_t report_stack[64];

typedef void (*vector)(void);

/* Entry 0 is the initial stack pointer, 1 the reset, 2 to 15 the core's exceptions, from 16 on the board's
 * interrupts up to the UART's. In an image without a receiver the UART's interrupt has no handler and is never
 * enabled. */
void pvid_uart_interrupt(void) __attribute__((weak));
void pvid_systick_interrupt(void) __attribute__((weak, alias("pvid_exception"))); /* an image may have its own */
__attribute__((section(".vectors"), used)) static const struct {
    uint32_t *stack;
    vector reset;
    vector exceptions[14];
    vector interrupts[PVID_UART_IRQ + 1u];
} vectors = {
    .stack = pvid_stack_top,
    .reset = pvid_reset,
    .exceptions = {pvid_exception, pvid_exception, pvid_exception, pvid_exception, pvid_exception, pvid_exception,
                   pvid_exception, pvid_exception, pvid_exception, pvid_exception, pvid_exception, pvid_exception,
                   pvid_exception, pvid_systick_interrupt},
    .interrupts = {[PVID_UART_IRQ] = pvid_uart_interrupt},
};

#define SYSTEM_REGISTER(address) (*(volatile uint32_t *)(uintptr_t)(address))
#define CPACR SYSTEM_REGISTER(0xE000ED88u)
#define CPACR_FPU_FULL_ACCESS 0x00F00000u
#define CFSR SYSTEM_REGISTER(0xE000ED28u)
#define HFSR SYSTEM_REGISTER(0xE000ED2Cu)
#define BFAR SYSTEM_REGISTER(0xE000ED38u)

#define MPU_CONTROL SYSTEM_REGISTER(0xE000ED94u)
#define MPU_REGION SYSTEM_REGISTER(0xE000ED98u)
#define MPU_BASE SYSTEM_REGISTER(0xE000ED9Cu)
#define MPU_ATTRIBUTES SYSTEM_REGISTER(0xE000EDA0u)
#define MPU_ENABLE_WITH_DEFAULT_MAP 0x5u
#define MPU_512_BYTES_NO_ACCESS 0x10000011u

#define CFSR_STACK_LIMIT 0x100000u   /* STKOF */
#define CFSR_STACKING 0x1010u        /* MSTKERR, STKERR: the exception's own frame could not be written */
#define CFSR_NO_COPROCESSOR 0x80000u /* NOCP: an FPU instruction without an FPU, or with it switched off */
#define CFSR_UNDEFINED 0x10000u
#define CFSR_BUS 0x0F00u
#define CFSR_MEMORY 0x00FFu

static void guard_stack(void)
{
#if defined(__ARM_ARCH_7M__) || defined(__ARM_ARCH_7EM__)
    MPU_REGION = 0u;
    MPU_BASE = (uint32_t)(uintptr_t)pvid_stack_guard;
    MPU_ATTRIBUTES = MPU_512_BYTES_NO_ACCESS;
    MPU_CONTROL = MPU_ENABLE_WITH_DEFAULT_MAP;
    __asm__ volatile("dsb\n\tisb" ::: "memory");
#elif defined(__ARM_ARCH_8M_MAIN__) || defined(__ARM_ARCH_8_1M_MAIN__)
    __asm__ volatile("msr msplim, %0" ::"r"(pvid_stack_bottom));
#endif
}

static bool is_stack_overflow(const uint32_t *frame)
{
    if (((uintptr_t)frame < (uintptr_t)pvid_stack_bottom) || ((uintptr_t)frame > ((uintptr_t)pvid_stack_top - 32u))) {
        return true;
    }
#if !defined(__ARM_ARCH_6M__) && !defined(__ARM_ARCH_8M_BASE__)
    return (CFSR & (CFSR_STACK_LIMIT | CFSR_STACKING)) != 0u;
#else
    return false;
#endif
}

void pvid_reset(void)
{
#if defined(__ARM_FP)
    CPACR |= CPACR_FPU_FULL_ACCESS;
    __asm__ volatile("dsb\n\tisb" ::: "memory");
#endif
    uint32_t *stack;
    __asm__ volatile("mov %0, sp" : "=r"(stack));
    guard_stack();
    pvid_start(stack);
}

/* The report runs on its own stack: the interrupted one may have caused the fault. */
__attribute__((naked)) void pvid_exception(void)
{
    __asm__ volatile("mrs r0, msp\n\t"
                     "mrs r1, ipsr\n\t"
                     "ldr r2, =%c0\n\t"
                     "mov sp, r2\n\t"
                     "ldr r2, =pvid_exception_report\n\t"
                     "bx r2\n\t"
                     ".ltorg"
                     :
                     : "i"(&report_stack[sizeof report_stack / sizeof report_stack[0]]));
}

static const char *cause(const uint32_t *frame, uint32_t exception)
{
    if (is_stack_overflow(frame)) {
        return "stack overflow,";
    }
    if ((exception < 3u) || (exception > 6u)) {
        return "unexpected exception,";
    }
#if !defined(__ARM_ARCH_6M__) && !defined(__ARM_ARCH_8M_BASE__)
    const uint32_t status = CFSR;
    if ((status & CFSR_NO_COPROCESSOR) != 0u) {
        return "FPU instruction and no FPU,";
    }
    if ((status & CFSR_UNDEFINED) != 0u) {
        return "undefined instruction,";
    }
    if ((status & CFSR_BUS) != 0u) {
        return "bus error,";
    }
    if ((status & CFSR_MEMORY) != 0u) {
        return "memory protection,";
    }
#endif
    return "hard fault,";
}

void pvid_exception_report(const uint32_t *frame, uint32_t exception)
{
    pvid_fault_begin(cause(frame, exception));
    pvid_fault_word("exception", exception);
    if (!is_stack_overflow(frame)) { /* else there is no frame */
        pvid_fault_word("pc", frame[6]);
        pvid_fault_word("lr", frame[5]);
    }
#if !defined(__ARM_ARCH_6M__) && !defined(__ARM_ARCH_8M_BASE__)
    pvid_fault_word("cfsr", CFSR);
    pvid_fault_word("hfsr", HFSR);
    pvid_fault_word("bfar", BFAR);
#endif
    pvid_fault_end();
}
