# What is installed, in components: `library`, `landing` and `autopilot` (what programs need at run time),
# `development` (what they are built with) and `command`.
include(CMakePackageConfigHelpers)

set(config_dir ${CMAKE_INSTALL_LIBDIR}/cmake/harco)

install(TARGETS harco EXPORT harcoTargets
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT library NAMELINK_COMPONENT development
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
if(TARGET harco_land)
  install(TARGETS harco_land EXPORT harcoTargets
    LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT landing NAMELINK_COMPONENT development
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
endif()
if(TARGET harco_autopilot)
  install(TARGETS harco_autopilot EXPORT harcoTargets
    LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT autopilot NAMELINK_COMPONENT development
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development)
endif()
install(DIRECTORY ${PROJECT_SOURCE_DIR}/include/harco
  DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT development FILES_MATCHING PATTERN *.hpp)
install(FILES ${PROJECT_BINARY_DIR}/include/harco/version.hpp
  DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/harco COMPONENT development)

# find_package(harco)
install(EXPORT harcoTargets NAMESPACE harco::
  DESTINATION ${config_dir} COMPONENT development)
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/harcoConfig.cmake.in
  ${PROJECT_BINARY_DIR}/harcoConfig.cmake INSTALL_DESTINATION ${config_dir}
  NO_SET_AND_CHECK_MACRO)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/harcoConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/harcoConfig.cmake ${PROJECT_BINARY_DIR}/harcoConfigVersion.cmake
  DESTINATION ${config_dir} COMPONENT development)

# pkg-config. Who links the static library links what is inside of it as well; the shared one brings
# it along.
set(pc_land_libraries "-lceres -lglog")
set(pc_autopilot_libraries "-lcrypto")
if(BUILD_SHARED_LIBS)
  set(pc_land_libraries "")
  set(pc_autopilot_libraries "")
  set(pc_requires "eigen3")
  set(pc_requires_private "libhwy, yaml-cpp")
else()
  set(pc_requires "eigen3, libhwy, yaml-cpp")
  set(pc_requires_private "")
endif()
file(RELATIVE_PATH pc_prefix /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
string(REGEX REPLACE "/$" "" pc_prefix ${pc_prefix})
configure_file(${CMAKE_CURRENT_LIST_DIR}/harco.pc.in ${PROJECT_BINARY_DIR}/harco.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/harco.pc
  DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT development)
if(TARGET harco_land)
  configure_file(${CMAKE_CURRENT_LIST_DIR}/harco-land.pc.in ${PROJECT_BINARY_DIR}/harco-land.pc
    @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/harco-land.pc
    DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT development)
endif()
if(TARGET harco_autopilot)
  configure_file(${CMAKE_CURRENT_LIST_DIR}/harco-autopilot.pc.in
    ${PROJECT_BINARY_DIR}/harco-autopilot.pc @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/harco-autopilot.pc
    DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT development)
endif()

# The command, and beside the libraries the modules that it loads when it needs them.
file(RELATIVE_PATH libraries_from_bin /${CMAKE_INSTALL_BINDIR} /${CMAKE_INSTALL_LIBDIR})
if(TARGET harco_command)
  set_target_properties(harco_command PROPERTIES INSTALL_RPATH $ORIGIN/${libraries_from_bin})
  install(TARGETS harco_command RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT command)
endif()
foreach(module harco_gstreamer harco_opencv harco_lab_module harco_deck_module)
  if(TARGET ${module})
    set_target_properties(${module} PROPERTIES INSTALL_RPATH $ORIGIN/..)
    install(TARGETS ${module}
      LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}/harco COMPONENT command)
  endif()
endforeach()

# `cpack` makes Debian packages.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_CONTACT "HArCo developers")
set(CPACK_RESOURCE_FILE_LICENSE ${PROJECT_SOURCE_DIR}/LICENSE)
set(CPACK_COMPONENTS_ALL development command)
if(BUILD_SHARED_LIBS)
  list(PREPEND CPACK_COMPONENTS_ALL library)
  if(TARGET harco_land)
    list(APPEND CPACK_COMPONENTS_ALL landing)
  endif()
  if(TARGET harco_autopilot)
    list(APPEND CPACK_COMPONENTS_ALL autopilot)
  endif()
  set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "libharco0 (= ${PROJECT_VERSION}), libeigen3-dev")
  set(CPACK_DEBIAN_COMMAND_PACKAGE_DEPENDS "libharco0 (= ${PROJECT_VERSION})")
else()
  set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "libeigen3-dev, libhwy-dev, libyaml-cpp-dev")
endif()
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_ENABLE_COMPONENT_DEPENDS OFF)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS ${PROJECT_BINARY_DIR}/src)
# Ceres is for who links harco::land, OpenSSL for who links harco::autopilot.
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SUGGESTS "libceres-dev, libssl-dev")
set(CPACK_DEBIAN_LIBRARY_PACKAGE_NAME libharco0)
set(CPACK_DEBIAN_LIBRARY_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_LANDING_PACKAGE_NAME libharco-land0)
set(CPACK_DEBIAN_LANDING_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_AUTOPILOT_PACKAGE_NAME libharco-autopilot0)
set(CPACK_DEBIAN_AUTOPILOT_PACKAGE_SECTION libs)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libharco-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_COMMAND_PACKAGE_NAME harco)
set(CPACK_DEBIAN_COMMAND_PACKAGE_SECTION utils)
include(CPack)
