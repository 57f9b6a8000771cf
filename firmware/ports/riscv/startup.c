/* Start of a RISC-V core in machine mode: stack, FPU, then main; every trap is a fault here, reported over
 * the UART with its cause. */
#include "../fault.h"
#include "../memory_map.h"
#include "../start.h"

void pvid_reset(void);
void pvid_trap(void);
void pvid_trap_report(void);

/* The report runs on its own stack: the interrupted one may have caused the fault. */
#define REPORT_STACK_BYTES 512
__attribute__((aligned(16), used)) uint8_t pvid_report_stack[REPORT_STACK_BYTES];

#define READ_CSR(name, value)                                                                                          \
    __asm__ volatile(".option push\n\t.option arch, +zicsr\n\tcsrr %0, " name "\n\t.option pop" : "=r"(value))

__attribute__((naked, section(".reset"))) void pvid_reset(void)
{
    __asm__ volatile(".option push\n\t"
                     ".option norelax\n\t"
                     ".option arch, +zicsr\n\t"
                     "la gp, __global_pointer$\n\t"
                     "la sp, pvid_stack_top\n\t"
                     "la t0, pvid_trap\n\t"
                     "csrw mtvec, t0\n\t"
#if defined(__riscv_flen)
                     "li t0, 0x2000\n\t" /* mstatus.FS: on */
                     "csrs mstatus, t0\n\t"
                     "csrw fcsr, zero\n\t" /* to nearest even */
#endif
#if !defined(PVID_NO_PROTECTION)
                     /* The page below the stack is inaccessible (PMP, NAPOT of 4 kB) and locked. */
                     "la t0, pvid_stack_guard + 0x7FF\n\t"
                     "srli t0, t0, 2\n\t"
                     "csrw pmpaddr0, t0\n\t"
                     "li t0, 0x98\n\t"
                     "csrw pmpcfg0, t0\n\t"
#endif
                     "mv a0, sp\n\t"
                     "la t0, pvid_start\n\t"
                     "jr t0\n\t"
                     ".option pop");
}

__attribute__((naked, aligned(4))) void pvid_trap(void)
{
    __asm__ volatile("la sp, pvid_report_stack + %0\n\t"
                     "la t0, pvid_trap_report\n\t"
                     "jr t0"
                     :
                     : "i"(REPORT_STACK_BYTES));
}

#define LOAD_FAULT 5u
#define STORE_FAULT 7u

static const char *cause(uint32_t code, uint32_t address)
{
    static const char *const causes[8] = {
        "misaligned jump,", "no memory to execute,", "illegal instruction,", "breakpoint,",
        "misaligned load,", "no memory to load,",    "misaligned store,",    "no memory to store,",
    };
    if (((code == LOAD_FAULT) || (code == STORE_FAULT)) && (address >= (uintptr_t)pvid_stack_guard) &&
        (address < (uintptr_t)pvid_stack_bottom)) {
        return "stack overflow,";
    }
    return (code < 8u) ? causes[code] : "unexpected trap,";
}

void pvid_trap_report(void)
{
    uint32_t code;
    uint32_t pc;
    uint32_t value;
    READ_CSR("mcause", code);
    READ_CSR("mepc", pc);
    READ_CSR("mtval", value);
    pvid_fault_begin(cause(code, value));
    pvid_fault_word("mcause", code);
    pvid_fault_word("pc", pc);
    pvid_fault_word("mtval", value);
    pvid_fault_end();
}
