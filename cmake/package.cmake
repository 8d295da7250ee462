# `cmake --install`: the program, the rooms' libraries with their public headers, and a package whose components are the
# rooms: find_package(tileflight COMPONENTS odometry). docs/library.md shows its use.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(PACKAGE_FOLDER ${CMAKE_INSTALL_LIBDIR}/cmake/tileflight)
if(TARGET tileflight)
  install(TARGETS tileflight RUNTIME COMPONENT runtime)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/adapters DESTINATION ${CMAKE_INSTALL_DATADIR}/tileflight USE_SOURCE_PERMISSIONS
          COMPONENT runtime)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/schemas DESTINATION ${CMAKE_INSTALL_DATADIR}/tileflight COMPONENT runtime)
endif()

set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME development)
# Each room is an export of its own, so that who asks for one needs the libraries of no other.
set_target_properties(tileflight_tinygltf PROPERTIES EXPORT_NAME tinygltf)
install(TARGETS tileflight_tinygltf EXPORT tileflight-tinygltf ARCHIVE)
install(EXPORT tileflight-tinygltf NAMESPACE tileflight:: DESTINATION ${PACKAGE_FOLDER})

get_property(ROOMS GLOBAL PROPERTY TILEFLIGHT_PACKAGE_ROOMS)
set(ROOM_LIST "")
foreach(ROOM IN LISTS ROOMS)
  install(TARGETS tileflight_${ROOM} EXPORT tileflight-${ROOM} ARCHIVE FILE_SET HEADERS)
  install(EXPORT tileflight-${ROOM} NAMESPACE tileflight:: DESTINATION ${PACKAGE_FOLDER})
  get_property(USES GLOBAL PROPERTY TILEFLIGHT_PACKAGE_${ROOM}_USES)
  get_property(LIBRARIES GLOBAL PROPERTY TILEFLIGHT_PACKAGE_${ROOM}_LIBRARIES)
  string(APPEND ROOM_LIST "set(_tileflight_${ROOM}_uses ${USES})\nset(_tileflight_${ROOM}_libraries ${LIBRARIES})\n")
endforeach()
configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/tileflightConfig.cmake.in
  ${PROJECT_BINARY_DIR}/package/tileflightConfig.cmake INSTALL_DESTINATION ${PACKAGE_FOLDER})
# Before version 1 a minor version may change any interface.
write_basic_package_version_file(${PROJECT_BINARY_DIR}/package/tileflightConfigVersion.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/package/tileflightConfig.cmake
              ${PROJECT_BINARY_DIR}/package/tileflightConfigVersion.cmake
              ${PROJECT_SOURCE_DIR}/cmake/tileflight_dependency.cmake
        DESTINATION ${PACKAGE_FOLDER})
