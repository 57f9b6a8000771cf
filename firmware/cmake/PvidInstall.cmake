# Install rules: find_package(pvid), pkg-config pvid.
include(CMakePackageConfigHelpers)
include(GNUInstallDirs)

install(TARGETS pvid EXPORT pvid-targets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(DIRECTORY include/pvid DESTINATION include)
install(FILES ${pvid_refine_model}/pvid/refine_shape.h DESTINATION include/pvid)
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR})
install(EXPORT pvid-targets NAMESPACE pvid:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/pvid)

# The exported target has no dependency to look up, so the targets file is the whole configuration.
file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/pvid-config.cmake
  "include(\"\${CMAKE_CURRENT_LIST_DIR}/pvid-targets.cmake\")\n"
)
# Before 1.0 a minor version may change a struct.
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/pvid-config-version.cmake
  COMPATIBILITY SameMinorVersion
)
install(
  FILES
    ${CMAKE_CURRENT_BINARY_DIR}/pvid-config.cmake
    ${CMAKE_CURRENT_BINARY_DIR}/pvid-config-version.cmake
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/pvid
)

set(pvid_pkgconfig_definitions "")
foreach(definition IN LISTS pvid_public_definitions)
  string(REPLACE "\"" "\\\"" definition "${definition}") # pkg-config unquotes as a shell does
  string(APPEND pvid_pkgconfig_definitions " -D${definition}")
endforeach()
file(RELATIVE_PATH pvid_prefix_from_pkgconfig # relative, so that an installed tree can be moved
  ${CMAKE_INSTALL_FULL_LIBDIR}/pkgconfig ${CMAKE_INSTALL_PREFIX}
)
configure_file(cmake/pvid.pc.in pvid.pc @ONLY)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/pvid.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
