# tileflight_room(NAME [USES room...] [TESTS room...] [PUBLIC lib...] [PRIVATE lib...] [HEADERS header...])
#
# Makes the library of a room from the folder's *.cpp, and its test program from the folder's *_test.cpp.
# USES names the rooms whose headers this one may include, TESTS those that only its tests may (docs/architecture.md);
# PUBLIC are libraries that its headers show, PRIVATE those that only its sources need; HEADERS are its public headers,
# which the installed package holds (docs/library.md).
include(GoogleTest)

if(TILEFLIGHT_TESTS OR TILEFLIGHT_BENCHMARKS)
  add_library(tileflight_source_folder STATIC ${PROJECT_SOURCE_DIR}/tests/source_folder.cpp)
  target_include_directories(tileflight_source_folder PRIVATE ${PROJECT_SOURCE_DIR})
  target_compile_definitions(tileflight_source_folder PRIVATE TILEFLIGHT_SOURCE_DIR="${PROJECT_SOURCE_DIR}")
endif()

# Rooms that are not compiled for speed: their work is short, or waits for a disk or a network.
set(TILEFLIGHT_QUICKLY_COMPILED drawing report rpc foxglove ros2 airsim publishing experiment external_systems study)

function(tileflight_room NAME)
  cmake_parse_arguments(ROOM "" "" "USES;TESTS;PUBLIC;PRIVATE;HEADERS" ${ARGN})
  file(GLOB SOURCES CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/*.cpp)
  set(TESTS ${SOURCES})
  list(FILTER TESTS INCLUDE REGEX "_test\\.cpp$")
  list(FILTER SOURCES EXCLUDE REGEX "_test\\.cpp$")

  if(NOT SOURCES)
    file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/empty.cpp "")
    set(SOURCES ${CMAKE_CURRENT_BINARY_DIR}/empty.cpp)
  endif()

  set(OUTSIDE ${ROOM_PUBLIC} ${ROOM_PRIVATE})
  list(REMOVE_ITEM OUTSIDE tileflight_tinygltf)
  tileflight_dependency(${OUTSIDE})

  set(TARGET tileflight_${NAME})
  set(ROOMS ${ROOM_USES})
  list(TRANSFORM ROOMS PREPEND "tileflight::")
  add_library(${TARGET} STATIC ${SOURCES})
  add_library(tileflight::${NAME} ALIAS ${TARGET})
  set_target_properties(${TARGET} PROPERTIES EXPORT_NAME ${NAME})
  target_sources(${TARGET} PUBLIC FILE_SET HEADERS BASE_DIRS ${PROJECT_SOURCE_DIR} FILES ${ROOM_HEADERS})
  target_include_directories(${TARGET} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>)
  target_compile_features(${TARGET} PUBLIC cxx_std_20)
  target_compile_options(${TARGET} PUBLIC ${TILEFLIGHT_RESULT_OPTIONS})
  target_link_libraries(${TARGET}
    PUBLIC ${ROOMS} ${ROOM_PUBLIC}
    PRIVATE ${ROOM_PRIVATE} $<BUILD_INTERFACE:tileflight_compiler>)
  # For the package: rooms and outside libraries that must be found before this one.
  set_property(GLOBAL APPEND PROPERTY TILEFLIGHT_PACKAGE_ROOMS ${NAME})
  set_property(GLOBAL PROPERTY TILEFLIGHT_PACKAGE_${NAME}_USES ${ROOM_USES})
  set_property(GLOBAL PROPERTY TILEFLIGHT_PACKAGE_${NAME}_LIBRARIES ${ROOM_PUBLIC} ${ROOM_PRIVATE})

  if(NAME IN_LIST TILEFLIGHT_QUICKLY_COMPILED)
    target_link_libraries(${TARGET} PRIVATE $<BUILD_INTERFACE:tileflight_quickly_compiled>)
  endif()

  # Rooms that parse untrusted bytes report to the fuzzer which branches they took.
  set(FUZZED base geometry imaging rpc foxglove ros2 autopilot fetch tile_content tileset mesh_files simplification tile_writer flight_logs missions)
  if(TILEFLIGHT_FUZZ AND NAME IN_LIST FUZZED)
    target_compile_options(${TARGET} PRIVATE -fsanitize=fuzzer-no-link)
  endif()

  if(TESTS AND TILEFLIGHT_TESTS)
    add_executable(${NAME}_test ${TESTS})
    list(TRANSFORM ROOM_TESTS PREPEND "tileflight::")
    target_link_libraries(${NAME}_test PRIVATE tileflight::${NAME} ${ROOM_TESTS} ${ROOM_PRIVATE} tileflight_compiler
                          tileflight_source_folder GTest::gmock GTest::gtest_main)
    set(PLAIN drawing imaging jobs fetch tile_content tileset mesh_files video dataset messages exports flight_logs flight_path missions place
              recording ingest preview external_systems report experiment project study)
    if(NAME IN_LIST PLAIN)
      target_link_libraries(${NAME}_test PRIVATE tileflight_plain_tests)
    endif()
    tileflight_add_gtest(${NAME}_test ${NAME})
  endif()
endfunction()

# tileflight_add_gtest(TARGET PREFIX [FILTER pattern] [PROPERTIES name value...])
#
# Registers each case of a GoogleTest program, or those that the filter names, with ctest as PREFIX.Suite.Case; a skipped
# case counts as skipped.
function(tileflight_add_gtest TARGET PREFIX)
  cmake_parse_arguments(CASES "" "FILTER" "PROPERTIES" ${ARGN})
  gtest_discover_tests(${TARGET}
    TEST_PREFIX "${PREFIX}."
    TEST_FILTER "${CASES_FILTER}"
    DISCOVERY_MODE PRE_TEST
    DISCOVERY_TIMEOUT 60
    WORKING_DIRECTORY ${PROJECT_BINARY_DIR}
    PROPERTIES TIMEOUT 600 SKIP_REGULAR_EXPRESSION "\\[  SKIPPED \\]" ${CASES_PROPERTIES})
endfunction()
