# Debian packages by CPack (`packaging/make-packages`): tileflight, tileflight-dev, python3-tileflight, tileflight-examples.
find_program(HELP2MAN help2man REQUIRED)
find_package(Python3 REQUIRED COMPONENTS Interpreter)
set(TILEFLIGHT_MAINTAINER "tileflight developers <tileflight@tileflight.invalid>" CACHE STRING
    "Maintainer named in the packages: who builds and publishes them")
set(MADE ${PROJECT_BINARY_DIR}/package)

# Manual pages and completion scripts are made from the program's own output.
add_custom_command(OUTPUT ${MADE}/made_by_program
  DEPENDS tileflight ${PROJECT_SOURCE_DIR}/packaging/make_man_pages.py
  COMMAND ${CMAKE_COMMAND} -E rm -rf ${MADE}/man ${MADE}/completion
  COMMAND ${CMAKE_COMMAND} -E make_directory ${MADE}/completion
  COMMAND tileflight completion bash > ${MADE}/completion/tileflight
  COMMAND tileflight completion zsh > ${MADE}/completion/_tileflight
  COMMAND ${Python3_EXECUTABLE} ${PROJECT_SOURCE_DIR}/packaging/make_man_pages.py $<TARGET_FILE:tileflight> ${PROJECT_VERSION} ${MADE}/man
  COMMAND gzip -9n ${MADE}/man/*.1
  COMMAND ${CMAKE_COMMAND} -E touch ${MADE}/made_by_program
  COMMENT "Manual pages and completion")
add_custom_target(tileflight_package_files ALL DEPENDS ${MADE}/made_by_program)
install(DIRECTORY ${MADE}/man/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT runtime)
install(FILES ${MADE}/completion/tileflight DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions COMPONENT runtime)
install(FILES ${MADE}/completion/_tileflight DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions COMPONENT runtime)

# The examples' first lines name their schemas, one folder up.
install(DIRECTORY ${PROJECT_SOURCE_DIR}/schemas DESTINATION ${CMAKE_INSTALL_DOCDIR}-examples COMPONENT examples)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/examples/ DESTINATION ${CMAKE_INSTALL_DOCDIR}-examples/examples COMPONENT examples
        EXCLUDE_FROM_ALL PATTERN __pycache__ EXCLUDE)
if(TILEFLIGHT_PYTHON)
  set(PYTHON_FOLDER lib/python3/dist-packages/tileflight)
  install(TARGETS tileflight_python LIBRARY DESTINATION ${PYTHON_FOLDER} COMPONENT python3 EXCLUDE_FROM_ALL)
  install(DIRECTORY ${PROJECT_BINARY_DIR}/python/tileflight/ DESTINATION ${PYTHON_FOLDER} COMPONENT python3 EXCLUDE_FROM_ALL
          FILES_MATCHING PATTERN "*.py" PATTERN "*.pyi" PATTERN py.typed PATTERN __pycache__ EXCLUDE)
endif()

# Packages of the same version for several Debians differ by what they were built on: 0.1.0+deb12.
cmake_host_system_information(RESULT DEBIAN QUERY DISTRIB_VERSION_ID)
set(PACKAGE_VERSION ${PROJECT_VERSION}+deb${DEBIAN})

# Each package's copyright and changelog (Debian Policy 12.5 and 12.7), dated like the commit that it is built from.
execute_process(COMMAND git log -1 --format=%aD WORKING_DIRECTORY ${PROJECT_SOURCE_DIR} OUTPUT_VARIABLE DATE
                OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
if(NOT DATE)
  string(TIMESTAMP DATE "%a, %d %b %Y %H:%M:%S +0000" UTC)
endif()
file(CONFIGURE OUTPUT ${MADE}/changelog CONTENT [[
tileflight (@PACKAGE_VERSION@) unstable; urgency=medium

  * Version @PROJECT_VERSION@; what changed is in CHANGELOG.md of the sources.

 -- @TILEFLIGHT_MAINTAINER@  @DATE@
]] @ONLY)
file(CONFIGURE OUTPUT ${MADE}/copyright CONTENT [[
Format: https://www.debian.org/doc/packaging-manuals/copyright-format/1.0/
Upstream-Name: tileflight

Files: *
Copyright: 2026 the tileflight authors
License: Apache-2.0
 On Debian systems, the text of the Apache License 2.0 is in
 /usr/share/common-licenses/Apache-2.0.
]] @ONLY)
execute_process(COMMAND gzip -9nkf ${MADE}/changelog)

set(CPACK_COMPONENTS_ALL runtime development examples)
if(TILEFLIGHT_PYTHON)
  list(APPEND CPACK_COMPONENTS_ALL python3)
endif()
set(PACKAGE_runtime tileflight)
set(PACKAGE_development tileflight-dev)
set(PACKAGE_python3 python3-tileflight)
set(PACKAGE_examples tileflight-examples)
foreach(COMPONENT IN LISTS CPACK_COMPONENTS_ALL)
  install(FILES ${MADE}/copyright ${MADE}/changelog.gz DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${PACKAGE_${COMPONENT}}
          COMPONENT ${COMPONENT} EXCLUDE_FROM_ALL)
  string(TOUPPER ${COMPONENT} NAME)
  set(CPACK_DEBIAN_${NAME}_PACKAGE_NAME ${PACKAGE_${COMPONENT}})
endforeach()

# A program that links the static libraries needs their libraries, too.
file(STRINGS ${PROJECT_SOURCE_DIR}/.ci/packages.txt LIBRARIES REGEX "^(lib.*|zlib1g|nlohmann-json3)-dev$")
list(JOIN LIBRARIES ", " LIBRARIES)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME tileflight)
set(CPACK_PACKAGE_VERSION ${PACKAGE_VERSION})
set(CPACK_PACKAGE_CONTACT "${TILEFLIGHT_MAINTAINER}")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)

set(CPACK_DEBIAN_RUNTIME_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_RUNTIME_PACKAGE_DEPENDS "fonts-dejavu-core, proj-data, ca-certificates")
set(CPACK_DEBIAN_RUNTIME_PACKAGE_RECOMMENDS python3)  # adapters of other SLAM systems
set(CPACK_DEBIAN_RUNTIME_PACKAGE_SUGGESTS "snakemake, colmap, python3-tileflight, tileflight-examples")
set(CPACK_COMPONENT_RUNTIME_DESCRIPTION "drone flights over 3D Tiles, and the accuracy of SLAM maps
Renders a drone's camera over 3D Tiles of a real place, runs visual odometry
(Direct Sparse Odometry, or another SLAM system) on simulated and filmed
flights, and measures how accurate the maps are against the exact surface.")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "${LIBRARIES}")
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION "C++ library of tileflight: headers and static libraries
Tile selection, exact voxels, rendering through lens models, direct sparse
odometry, registration and evaluation of maps, one CMake component each.")
math(EXPR NEXT_PYTHON "${Python3_VERSION_MINOR} + 1")
set(CPACK_DEBIAN_PYTHON3_PACKAGE_SECTION python)
set(CPACK_DEBIAN_PYTHON3_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PYTHON3_PACKAGE_DEPENDS "tileflight (= ${PACKAGE_VERSION}), python3 (>= 3.${Python3_VERSION_MINOR}), python3 (<< 3.${NEXT_PYTHON}), python3-numpy")
set(CPACK_DEBIAN_PYTHON3_PACKAGE_CONTROL_EXTRA "${PROJECT_SOURCE_DIR}/packaging/python3/postinst;${PROJECT_SOURCE_DIR}/packaging/python3/prerm")
set(CPACK_COMPONENT_PYTHON3_DESCRIPTION "Python module of tileflight
Scenes of 3D Tiles, images, depth, lidar, odometry, registration, scores and
the simulator with numpy arrays; every command of the program as a function.")
set(CPACK_DEBIAN_EXAMPLES_PACKAGE_ARCHITECTURE all)
set(CPACK_DEBIAN_EXAMPLES_PACKAGE_RECOMMENDS "tileflight")
set(CPACK_COMPONENT_EXAMPLES_DESCRIPTION "example experiments and programs for tileflight
Experiments, flights, cameras and studies over the built-in stadium, and
programs in C++ and Python that use the library.")
include(CPack)
