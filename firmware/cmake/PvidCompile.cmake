# How the core is compiled: shared by the library and by the Python side's build of the same sources.

# Without the first two the compiler may fuse a*b+c or reassociate, and the bits are no longer those of the twin. Without
# the third gcc 12 takes an array that it addresses by a bare offset for a null pointer, its function for one that
# returns nothing, and removes the call (tests/core/test_dropped_calls.py).
set(PVID_CORE_OPTIONS -ffp-contract=off -fno-fast-math -fno-delete-null-pointer-checks)

# Strict C99 (or what CMAKE_C_STANDARD names), without GNU extensions (ISO mode itself forbids excess precision), but
# for a board whose constants stay in flash only by one of them: PVID_C_EXTENSIONS.
set(PVID_C_EXTENSIONS OFF CACHE INTERNAL "GNU extensions") # cache: images are made in the scope of who includes us
function(pvid_compile_as_core target)
  target_compile_options(${target} PRIVATE ${PVID_CORE_OPTIONS})
  if(NOT CMAKE_C_STANDARD)
    set_target_properties(${target} PROPERTIES C_STANDARD 99)
  endif()
  set_target_properties(${target} PROPERTIES C_STANDARD_REQUIRED ON C_EXTENSIONS ${PVID_C_EXTENSIONS})
endfunction()

set(PVID_DEVELOPER_WARNINGS
  -Werror
  -Wall
  -Wextra
  -Wpedantic
  -Wcast-align
  -Wcast-qual
  -Wconversion
  -Wdouble-promotion
  -Wfloat-equal
  -Wmissing-prototypes
  -Wshadow
  -Wstrict-prototypes
  -Wundef
  -Wvla
)

# With PVID_DEVELOPER: the warnings above are errors. A user's newer compiler is not to fail on one.
function(pvid_developer_warnings target)
  if(PVID_DEVELOPER)
    target_compile_options(${target} PRIVATE ${PVID_DEVELOPER_WARNINGS})
  endif()
endfunction()
