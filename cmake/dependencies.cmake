# The field's libraries, all from Debian 12 (.ci/packages.txt). Each becomes a target that stages link by name.
# A stage that is built alone (TILEFLIGHT_ONLY) still finds all of them: set-up is one for everybody.

find_package(PkgConfig REQUIRED)
find_package(Threads REQUIRED)
find_package(Eigen3 REQUIRED NO_MODULE)
find_package(TBB REQUIRED)
find_package(GTest REQUIRED)
find_package(nlohmann_json REQUIRED)
find_package(yaml-cpp REQUIRED)
find_package(PNG REQUIRED)
find_package(JPEG REQUIRED)
find_package(OpenEXR REQUIRED CONFIG)
find_package(embree 3 REQUIRED CONFIG)
find_package(Ceres REQUIRED)
find_package(meshoptimizer REQUIRED CONFIG)
find_package(benchmark REQUIRED)
find_package(ZLIB REQUIRED)
find_package(SQLite3 REQUIRED)
find_package(CURL REQUIRED)
find_package(EXPAT REQUIRED)
find_package(OpenSSL REQUIRED COMPONENTS Crypto)

pkg_check_modules(proj REQUIRED IMPORTED_TARGET proj)
pkg_check_modules(exif REQUIRED IMPORTED_TARGET libexif)
pkg_check_modules(webp REQUIRED IMPORTED_TARGET libwebp)
pkg_check_modules(cairo REQUIRED IMPORTED_TARGET cairo)
pkg_check_modules(draco REQUIRED IMPORTED_TARGET draco)
pkg_check_modules(zstd REQUIRED IMPORTED_TARGET libzstd)
pkg_check_modules(lzf REQUIRED IMPORTED_TARGET liblzf)
pkg_check_modules(re2 REQUIRED IMPORTED_TARGET re2)
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

# Debian's libtinygltf.so does not agree with its header on the size of some structures (a crash when a model is freed), so
# the implementation is compiled from the header. Pictures are ours to decode: no stb_image.
find_path(tinygltf_INCLUDE_DIR tiny_gltf.h REQUIRED)
file(CONFIGURE OUTPUT ${CMAKE_BINARY_DIR}/tinygltf/tinygltf.cpp CONTENT [[
#include <nlohmann/json.hpp>
#define TINYGLTF_IMPLEMENTATION
#include <tiny_gltf.h>
]] @ONLY)
add_library(tileflight_tinygltf STATIC ${CMAKE_BINARY_DIR}/tinygltf/tinygltf.cpp)
target_compile_definitions(tileflight_tinygltf
  PUBLIC TINYGLTF_NO_STB_IMAGE TINYGLTF_NO_STB_IMAGE_WRITE TINYGLTF_NO_EXTERNAL_IMAGE TINYGLTF_NO_INCLUDE_JSON)
target_include_directories(tileflight_tinygltf SYSTEM PUBLIC ${tinygltf_INCLUDE_DIR})
target_link_libraries(tileflight_tinygltf PRIVATE nlohmann_json::nlohmann_json)

find_path(CLI11_INCLUDE_DIR CLI/CLI.hpp REQUIRED)
add_library(tileflight_cli11 INTERFACE)
target_include_directories(tileflight_cli11 SYSTEM INTERFACE ${CLI11_INCLUDE_DIR})

find_path(msgpack_INCLUDE_DIR msgpack.hpp REQUIRED)
add_library(tileflight_msgpack INTERFACE)
target_include_directories(tileflight_msgpack SYSTEM INTERFACE ${msgpack_INCLUDE_DIR})
target_compile_definitions(tileflight_msgpack INTERFACE MSGPACK_NO_BOOST)

find_path(asio_INCLUDE_DIR asio.hpp REQUIRED)
add_library(tileflight_asio INTERFACE)
target_include_directories(tileflight_asio SYSTEM INTERFACE ${asio_INCLUDE_DIR})
target_compile_definitions(tileflight_asio INTERFACE ASIO_STANDALONE ASIO_NO_DEPRECATED)
target_link_libraries(tileflight_asio INTERFACE Threads::Threads)

# Optional: frames rendered by several processes. Its C interface only. What it keeps until exit would be taken for leaks.
option(TILEFLIGHT_MPI "Open MPI, for `mpirun -n N tileflight render`" ON)
if(TILEFLIGHT_SANITIZE)
  set(TILEFLIGHT_MPI OFF)
endif()
if(TILEFLIGHT_MPI)
  pkg_check_modules(ompi IMPORTED_TARGET ompi-c)
  if(NOT ompi_FOUND)
    message(STATUS "No Open MPI here: tileflight render runs as one process")
    set(TILEFLIGHT_MPI OFF)
  endif()
endif()
