# hexapod_package(TARGET COMPONENT HEADERS...) installs a library of this project for C programs:
#   find_package(hexapod COMPONENTS plant) gives hexapod::plant, pkg-config provides hexapod-plant
# Components are installed separately, into one prefix, by one or several projects.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(HX_PACKAGE_DIR ${CMAKE_CURRENT_LIST_DIR})

function(hexapod_package target component)
  set(config ${CMAKE_INSTALL_LIBDIR}/cmake/hexapod)
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${component} VERSION ${hexapod_VERSION}
    SOVERSION ${hexapod_VERSION_MAJOR}.${hexapod_VERSION_MINOR})
  target_include_directories(${target} INTERFACE $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  install(TARGETS ${target} EXPORT hexapod-${component}
    RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR}
    LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
  install(EXPORT hexapod-${component} NAMESPACE hexapod:: DESTINATION ${config})
  install(FILES ${ARGN} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/hexapod)
  install(DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR}/include/hexapod/generated
    DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/hexapod)
  install(FILES ${HX_LICENCE} DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/hexapod)

  configure_package_config_file(${HX_PACKAGE_DIR}/hexapodConfig.cmake.in hexapodConfig.cmake
    INSTALL_DESTINATION ${config})
  # before 1.0 a minor version may change the binary interface
  write_basic_package_version_file(hexapodConfigVersion.cmake
    VERSION ${hexapod_VERSION} COMPATIBILITY SameMinorVersion)
  set(here ${CMAKE_CURRENT_BINARY_DIR})
  install(FILES ${here}/hexapodConfig.cmake ${here}/hexapodConfigVersion.cmake DESTINATION ${config})

  # relative paths, so that the prefix can be moved
  file(RELATIVE_PATH prefix "${CMAKE_INSTALL_FULL_LIBDIR}/pkgconfig" "${CMAKE_INSTALL_PREFIX}")
  configure_file(${HX_PACKAGE_DIR}/hexapod.pc.in hexapod-${component}.pc @ONLY)
  install(FILES ${here}/hexapod-${component}.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
endfunction()
