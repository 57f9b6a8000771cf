# The fixed-point core holds no floating point, by its objects for a core without an FPU:
#
#     cmake -DARCHIVE=libpvid.a -DAR=ar -DNM=nm -DOBJDUMP=objdump -DFOLDER=scratch -P no_float.cmake
#
# fails iff one of them calls soft float or has an instruction on floating-point registers, or there are none of them.
cmake_minimum_required(VERSION 3.20)

# What libgcc's soft float is called: of ARM, and of the others.
set(soft_float "__aeabi_([cdf]|u?[il]2[df])[a-z0-9]*|__(add|sub|mul|div|neg|eq|ne|lt|le|gt|ge|fix|float|extend)[a-z]*[sdtx]f[a-z0-9]*")
set(instruction "\t(v(add|sub|mul|div|ldr|str|mov|cvt|sqrt|cmp)|f(add|sub|mul|div|lw|sw|ld|sd|cvt|mv))[.\t]")

# tool(RESULT COMMAND...): what it prints.
function(tool result)
  execute_process(COMMAND ${ARGN} WORKING_DIRECTORY ${FOLDER} OUTPUT_VARIABLE printed COMMAND_ERROR_IS_FATAL ANY)
  set(${result} "${printed}" PARENT_SCOPE)
endfunction()

file(REMOVE_RECURSE ${FOLDER})
file(MAKE_DIRECTORY ${FOLDER})
tool(ignored ${AR} x ${ARCHIVE})
file(GLOB objects ${FOLDER}/*_q31.c.o* ${FOLDER}/fnv.c.o*)
list(LENGTH objects count)
if(count LESS 10)
  message(FATAL_ERROR "${ARCHIVE} has ${count} objects of the fixed-point core: where are the others?")
endif()
foreach(object IN LISTS objects)
  get_filename_component(name ${object} NAME)
  tool(called ${NM} --undefined-only ${object})
  if(called MATCHES "${soft_float}")
    message(FATAL_ERROR "${name} calls ${CMAKE_MATCH_0}: the fixed-point core is to hold no floating point")
  endif()
  tool(listing ${OBJDUMP} -d ${object})
  if(listing MATCHES "${instruction}")
    message(FATAL_ERROR "${name} has the instruction${CMAKE_MATCH_0}: the fixed-point core is to hold no floating point")
  endif()
endforeach()
file(REMOVE_RECURSE ${FOLDER})
