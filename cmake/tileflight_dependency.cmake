# tileflight_dependency(TARGET...): finds the outside library of each target, unless the target is there already.
#
# One list for two readers: the build, which finds all of them (dependencies.cmake), and the installed package, which
# finds those of the rooms that are asked for (tileflightConfig.cmake.in).
include(CMakeFindDependencyMacro)

# CMake target → arguments of find_package.
set(_tileflight_package_Threads::Threads Threads)
set(_tileflight_package_Eigen3::Eigen Eigen3)
set(_tileflight_package_TBB::tbb TBB)
set(_tileflight_package_nlohmann_json::nlohmann_json nlohmann_json)
set(_tileflight_package_yaml-cpp yaml-cpp)
set(_tileflight_package_PNG::PNG PNG)
set(_tileflight_package_JPEG::JPEG JPEG)
set(_tileflight_package_OpenEXR::OpenEXR OpenEXR CONFIG)
set(_tileflight_package_embree embree 3 CONFIG)
set(_tileflight_package_Ceres::ceres Ceres)
set(_tileflight_package_meshoptimizer::meshoptimizer meshoptimizer CONFIG)
set(_tileflight_package_ZLIB::ZLIB ZLIB)
set(_tileflight_package_SQLite::SQLite3 SQLite3)
set(_tileflight_package_CURL::libcurl CURL)
set(_tileflight_package_EXPAT::EXPAT EXPAT)
set(_tileflight_package_OpenSSL::Crypto OpenSSL COMPONENTS Crypto)
set(_tileflight_package_CycloneDDS::ddsc CycloneDDS CONFIG)

# PkgConfig::NAME → modules of pkg-config, where they are not called NAME.
set(_tileflight_modules_exif libexif)
set(_tileflight_modules_libav libavformat libavcodec libswscale libavutil)
set(_tileflight_modules_lzf liblzf)
set(_tileflight_modules_webp libwebp)
set(_tileflight_modules_zstd libzstd)

# tileflight_NAME → a header of a library that is headers only and brings neither.
set(_tileflight_header_tileflight_asio asio.hpp)
set(_tileflight_header_tileflight_msgpack msgpack.hpp)

macro(tileflight_dependency)
  foreach(_TARGET IN ITEMS ${ARGN})
    if(TARGET ${_TARGET})
    elseif(DEFINED _tileflight_package_${_TARGET})
      find_dependency(${_tileflight_package_${_TARGET}})
    elseif(_TARGET MATCHES "^PkgConfig::(.+)$")
      set(_NAME ${CMAKE_MATCH_1})
      set(_MODULES ${_NAME})
      if(DEFINED _tileflight_modules_${_NAME})
        set(_MODULES ${_tileflight_modules_${_NAME}})
      endif()
      find_dependency(PkgConfig)
      pkg_check_modules(${_NAME} REQUIRED IMPORTED_TARGET GLOBAL ${_MODULES})
    elseif(DEFINED _tileflight_header_${_TARGET})
      find_path(${_TARGET}_INCLUDE_DIR ${_tileflight_header_${_TARGET}} REQUIRED)
      mark_as_advanced(${_TARGET}_INCLUDE_DIR)
      add_library(${_TARGET} INTERFACE IMPORTED GLOBAL)
      target_include_directories(${_TARGET} SYSTEM INTERFACE ${${_TARGET}_INCLUDE_DIR})
    else()
      message(FATAL_ERROR "tileflight_dependency: nothing is known of ${_TARGET}")
    endif()
  endforeach()
endmacro()
