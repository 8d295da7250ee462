# The field's libraries, all from Debian 12 (.ci/packages.txt). Each becomes a target that stages link by name.
# A stage that is built alone (TILEFLIGHT_ONLY) still finds all of them: set-up is one for everybody.

find_package(PkgConfig REQUIRED)
find_package(Threads REQUIRED)
find_package(Eigen3 REQUIRED NO_MODULE)
find_package(TBB REQUIRED)
find_package(GTest REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(yaml-cpp REQUIRED)
find_package(spdlog REQUIRED)
find_package(PNG REQUIRED)
find_package(JPEG REQUIRED)
find_package(OpenEXR REQUIRED CONFIG)
find_package(embree 3 REQUIRED CONFIG)
find_package(Ceres REQUIRED)
find_package(benchmark REQUIRED)

pkg_check_modules(proj REQUIRED IMPORTED_TARGET proj)
pkg_check_modules(webp REQUIRED IMPORTED_TARGET libwebp)
pkg_check_modules(draco REQUIRED IMPORTED_TARGET draco)
pkg_check_modules(libav REQUIRED IMPORTED_TARGET libavformat libavcodec libswscale libavutil)

find_path(GeographicLib_INCLUDE_DIR GeographicLib/Geocentric.hpp REQUIRED)
find_library(GeographicLib_LIBRARY NAMES GeographicLib Geographic REQUIRED)
add_library(tileflight_geographiclib INTERFACE)
target_include_directories(tileflight_geographiclib SYSTEM INTERFACE ${GeographicLib_INCLUDE_DIR})
target_link_libraries(tileflight_geographiclib INTERFACE ${GeographicLib_LIBRARY})

find_path(nanoflann_INCLUDE_DIR nanoflann.hpp REQUIRED)
add_library(tileflight_nanoflann INTERFACE)
target_include_directories(tileflight_nanoflann SYSTEM INTERFACE ${nanoflann_INCLUDE_DIR})

find_path(octomap_INCLUDE_DIR octomap/octomap.h REQUIRED)
find_library(octomap_LIBRARY octomap REQUIRED)
find_library(octomath_LIBRARY octomath REQUIRED)
add_library(tileflight_octomap INTERFACE)
target_include_directories(tileflight_octomap SYSTEM INTERFACE ${octomap_INCLUDE_DIR})
target_link_libraries(tileflight_octomap INTERFACE ${octomap_LIBRARY} ${octomath_LIBRARY})

find_path(tinygltf_INCLUDE_DIR tiny_gltf.h REQUIRED)
find_library(tinygltf_LIBRARY tinygltf REQUIRED)
add_library(tileflight_tinygltf INTERFACE)
target_include_directories(tileflight_tinygltf SYSTEM INTERFACE ${tinygltf_INCLUDE_DIR})
target_link_libraries(tileflight_tinygltf INTERFACE ${tinygltf_LIBRARY})

find_path(CLI11_INCLUDE_DIR CLI/CLI.hpp REQUIRED)
add_library(tileflight_cli11 INTERFACE)
target_include_directories(tileflight_cli11 SYSTEM INTERFACE ${CLI11_INCLUDE_DIR})
