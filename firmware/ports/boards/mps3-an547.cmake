# Arm MPS3 with image AN547: Cortex-M55, FPU without the vector extension. QEMU: -machine mps3-an547.
#
# +nomve is part of the promise of equal bits: with MVE gcc turns float loops into vectors even at -O2, and vectors
# flush subnormals to zero, which pvid_arithmetic_faults_f32(), a matter of scalars, does not see.
set(PVID_BOARD_FAMILY cortex_m)
set(PVID_BOARD_CPU -mcpu=cortex-m55+nomve -mfloat-abi=hard)
set(PVID_BOARD_UART cmsdk)
set(PVID_BOARD_DEFINITIONS PVID_UART_BASE=0x59303000u PVID_UART_IRQ=33u PVID_CLOCK_HZ=32000000u)
set(PVID_BOARD_MEMORY code_origin=0 code_bytes=512K ram_origin=0x20000000 ram_bytes=512K stack_bytes=16K)
