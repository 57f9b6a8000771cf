# A build for one board: PVID_BOARD names a file of ports/boards. In a project of your own
#     set(PVID_BOARD mps2-an386)
#     add_subdirectory(pvid/firmware)
#     pvid_add_image(name main.c ...)
# makes name.elf, with the core and the board's start-up, port and memory map.

set(pvid_ports ${CMAKE_CURRENT_LIST_DIR}/../ports)
set(pvid_board_file ${pvid_ports}/boards/${PVID_BOARD}.cmake)
if(NOT EXISTS ${pvid_board_file})
  file(GLOB pvid_boards RELATIVE ${pvid_ports}/boards ${pvid_ports}/boards/*.cmake)
  list(TRANSFORM pvid_boards REPLACE "\\.cmake$" "")
  list(JOIN pvid_boards ", " pvid_boards)
  message(FATAL_ERROR "PVID_BOARD is ${PVID_BOARD}; there are ${pvid_boards}")
endif()
include(${pvid_board_file})

if(PVID_BOARD_FAMILY STREQUAL "cortex_m")
  set(pvid_toolchain cortex-m)
else()
  set(pvid_toolchain ${PVID_BOARD_FAMILY})
endif()
if(NOT CMAKE_CROSSCOMPILING)
  message(FATAL_ERROR "${PVID_BOARD} needs a cross compiler: --toolchain firmware/cmake/${pvid_toolchain}.cmake")
endif()

# Whatever is built for the board: its core, and nothing that is not there.
add_library(pvid_board INTERFACE)
target_compile_options(pvid_board INTERFACE
  ${PVID_BOARD_CPU}
  -ffunction-sections
  -fdata-sections
  -fstack-usage     # read by `pvid sizes`
  -fno-math-errno   # sqrtf is one instruction where there is one
  -fno-schedule-insns # gcc hoists so many loads that it runs out of FPU registers: 5 % of the strong form's tick
  -fno-cse-follow-jumps # else gcc keeps copies of the arguments: 4 instructions of each tick of the weak form
)
target_link_options(pvid_board INTERFACE ${PVID_BOARD_CPU} -Wl,--gc-sections)

set(pvid_port_sources ${pvid_ports}/fault.c)
if(PVID_BOARD_FAMILY STREQUAL "avr")
  list(APPEND pvid_port_sources ${pvid_ports}/avr/port.c)
  set(PVID_C_EXTENSIONS ON CACHE INTERNAL "GNU extensions")
  target_compile_definitions(pvid_board INTERFACE PVID_TABLE=__flash)
else()
  # No C library: the compiler's own headers, the two of freestanding/, and the compiler's arithmetic (libgcc).
  target_compile_options(pvid_board INTERFACE -ffreestanding -fbuiltin)
  target_include_directories(pvid_board INTERFACE ${pvid_ports}/freestanding/include)
  list(TRANSFORM PVID_BOARD_MEMORY PREPEND "-Wl,--defsym=pvid_" OUTPUT_VARIABLE pvid_memory_options)
  set(pvid_linker_script ${pvid_ports}/${PVID_BOARD_FAMILY}/link.ld)
  target_link_options(pvid_board INTERFACE -nostdlib -T${pvid_linker_script} ${pvid_memory_options})
  set_target_properties(pvid_board PROPERTIES INTERFACE_LINK_DEPENDS ${pvid_linker_script})
  target_link_libraries(pvid_board INTERFACE gcc)
  list(APPEND pvid_port_sources
    ${pvid_ports}/freestanding/memory.c
    ${pvid_ports}/freestanding/square_root.c
    ${pvid_ports}/start.c
    ${pvid_ports}/uart/uart_port.c
    ${pvid_ports}/uart/uart_${PVID_BOARD_UART}.c
    ${pvid_ports}/${PVID_BOARD_FAMILY}/startup.c
    ${pvid_ports}/${PVID_BOARD_FAMILY}/port.c
  )
  # Loops that fill and copy must not become calls of themselves.
  set_source_files_properties(
    ${pvid_ports}/freestanding/memory.c ${pvid_ports}/start.c
    PROPERTIES COMPILE_OPTIONS -fno-tree-loop-distribute-patterns
  )
  set(PVID_MATH_LIBRARY "")
endif()

# Objects, not an archive: the start-up is called by nobody.
add_library(pvid_port OBJECT ${pvid_port_sources})
target_include_directories(pvid_port PUBLIC ${pvid_ports})
target_compile_definitions(pvid_port PRIVATE ${PVID_BOARD_DEFINITIONS})
target_link_libraries(pvid_port PUBLIC pvid_board)
set_target_properties(pvid_port PROPERTIES C_STANDARD 99 C_STANDARD_REQUIRED ON C_EXTENSIONS OFF)
pvid_developer_warnings(pvid_port)

# Reception by interrupt (ports/receiver.h), for images that link it.
if(NOT PVID_BOARD_FAMILY STREQUAL "avr")
  add_library(pvid_receiver OBJECT ${pvid_ports}/uart/receiver.c ${pvid_ports}/${PVID_BOARD_FAMILY}/interrupts.c)
  target_include_directories(pvid_receiver PUBLIC ${pvid_ports})
  target_compile_definitions(pvid_receiver PRIVATE ${PVID_BOARD_DEFINITIONS})
  target_link_libraries(pvid_receiver PUBLIC pvid_board)
  set_target_properties(pvid_receiver PROPERTIES C_STANDARD 99 C_STANDARD_REQUIRED ON C_EXTENSIONS OFF)
  pvid_developer_warnings(pvid_receiver)
endif()

function(pvid_add_image name)
  add_executable(${name} ${ARGN})
  pvid_compile_as_core(${name})
  pvid_developer_warnings(${name})
  set_target_properties(${name} PROPERTIES SUFFIX .elf)
  target_compile_definitions(${name} PRIVATE PVID_BOARD_NAME="${PVID_BOARD}")
  target_link_libraries(${name} PRIVATE pvid_port pvid::pvid)
  target_link_options(${name} PRIVATE -Wl,-Map=${CMAKE_CURRENT_BINARY_DIR}/${name}.map)
endfunction()
