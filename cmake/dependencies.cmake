# The field's libraries, all from Debian 12 (.ci/packages.txt). A room finds those that it names (room.cmake).
set(CMAKE_FIND_PACKAGE_NAME tileflight)  # find_dependency() then fails here as find_package(… REQUIRED) does
set(tileflight_FIND_REQUIRED TRUE)
set(CMAKE_FIND_PACKAGE_TARGETS_GLOBAL TRUE)  # one room finds a library for all
include(tileflight_dependency)

if(TILEFLIGHT_TESTS)
  find_package(GTest REQUIRED)
endif()

# Debian's libtinygltf.so does not agree with its header on the size of some structures (a crash when a model is freed), so
# the implementation is compiled from the header. The room imaging decodes images, so stb_image is left out.
find_path(tinygltf_INCLUDE_DIR tiny_gltf.h REQUIRED)
tileflight_dependency(nlohmann_json::nlohmann_json)
file(CONFIGURE OUTPUT ${PROJECT_BINARY_DIR}/tinygltf/tinygltf.cpp CONTENT [[
#include <nlohmann/json.hpp>
#define TINYGLTF_IMPLEMENTATION
#include <tiny_gltf.h>
]] @ONLY)
add_library(tileflight_tinygltf STATIC ${PROJECT_BINARY_DIR}/tinygltf/tinygltf.cpp)
target_compile_definitions(tileflight_tinygltf
  PUBLIC TINYGLTF_NO_STB_IMAGE TINYGLTF_NO_STB_IMAGE_WRITE TINYGLTF_NO_EXTERNAL_IMAGE TINYGLTF_NO_INCLUDE_JSON)
target_include_directories(tileflight_tinygltf SYSTEM PUBLIC $<BUILD_INTERFACE:${tinygltf_INCLUDE_DIR}>)
target_link_libraries(tileflight_tinygltf PRIVATE $<BUILD_INTERFACE:nlohmann_json::nlohmann_json>)
