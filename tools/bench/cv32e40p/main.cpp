/* Plays an image of ports/boards/cv32e40p*.cmake on the core that verilator has translated: main IMAGE.bin.
 *
 * Memory is ideal: every access is granted in the cycle of its request and answered in the next one. What the image
 * sends goes to standard output; the exit code is the image's own, 124 when it does not end.
 */
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <vector>

#include "Vcv32e40p_top.h"
#include "verilated.h"

namespace
{

constexpr uint32_t MEMORY = 0x80000000u; // code and RAM, one behind the other
constexpr uint32_t MEMORY_BYTES = 16u << 20;
constexpr uint32_t UART_DATA = 0x10000000u; // a word of the bus: data in its lowest byte, line status in the next word
constexpr uint32_t UART_STATUS = 0x10000004u;
constexpr uint32_t UART_IDLE = 0x60u << 8; // byte 5
constexpr uint32_t FINISHER = 0x100000u;
constexpr uint64_t MOST_CYCLES = 4000000000u;
constexpr int NO_END = 124;
constexpr int NO_EXIT = -1;

std::vector<uint8_t> memory(MEMORY_BYTES);

uint32_t read(uint32_t address)
{
    const uint32_t at = (address & ~3u) - MEMORY;
    if (at < MEMORY_BYTES) {
        uint32_t word;
        std::memcpy(&word, &memory[at], sizeof word);
        return word;
    }
    return ((address & ~3u) == UART_STATUS) ? UART_IDLE : 0u;
}

/* Returns the exit code where the image ends. */
int write(uint32_t address, uint32_t word, uint32_t lanes)
{
    const uint32_t at = (address & ~3u) - MEMORY;
    if (at < MEMORY_BYTES) {
        for (unsigned lane = 0; lane < 4u; lane++) {
            if ((lanes >> lane) & 1u) {
                memory[at + lane] = static_cast<uint8_t>(word >> (8u * lane));
            }
        }
    } else if (((address & ~3u) == UART_DATA) && (lanes & 1u)) {
        std::putchar(static_cast<int>(word & 0xFFu));
    } else if (address == FINISHER) {
        return static_cast<int>(word >> 16); /* 0 for a pass */
    }
    return NO_EXIT;
}

} // namespace

int main(int argc, char **argv)
{
    FILE *image = (argc == 2) ? std::fopen(argv[1], "rb") : nullptr;
    if ((image == nullptr) || (std::fread(memory.data(), 1, MEMORY_BYTES, image) == 0)) {
        std::fputs("no image\n", stderr);
        return 2;
    }
    std::fclose(image);
    Vcv32e40p_top core;
    core.pulp_clock_en_i = 1;
    core.scan_cg_en_i = 0;
    core.boot_addr_i = MEMORY;
    core.mtvec_addr_i = MEMORY;
    core.dm_halt_addr_i = MEMORY;
    core.dm_exception_addr_i = MEMORY;
    core.hart_id_i = 0;
    core.irq_i = 0;
    core.debug_req_i = 0;
    core.fetch_enable_i = 1;
    core.instr_gnt_i = 1;
    core.data_gnt_i = 1;
    for (uint64_t cycle = 0; cycle < MOST_CYCLES; cycle++) {
        core.rst_ni = (cycle < 4u) ? 0 : 1;
        core.clk_i = 0;
        core.eval();
        /* The requests of this cycle, answered behind its edge. */
        const bool fetches = core.rst_ni && core.instr_req_o;
        const bool accesses = core.rst_ni && core.data_req_o;
        const uint32_t instruction = fetches ? read(core.instr_addr_o) : 0u;
        uint32_t data = 0u;
        if (accesses && core.data_we_o) {
            const int code = write(core.data_addr_o, core.data_wdata_o, core.data_be_o);
            if (code != NO_EXIT) {
                return code;
            }
        } else if (accesses) {
            data = read(core.data_addr_o);
        }
        core.clk_i = 1;
        core.eval();
        core.instr_rvalid_i = fetches;
        core.instr_rdata_i = instruction;
        core.data_rvalid_i = accesses;
        core.data_rdata_i = data;
    }
    return NO_END;
}
