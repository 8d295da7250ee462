# tileflight_room(NAME [USES room...] [TESTS room...] [PUBLIC lib...] [PRIVATE lib...])
#
# Makes the library of a room from the folder's *.cpp, and its test program from the folder's *_test.cpp.
# USES names the rooms whose headers this one may include, TESTS those that only its tests may (docs/architecture.md); PUBLIC are libraries that
# its headers show, PRIVATE those that only its sources need.
include(GoogleTest)

function(tileflight_room NAME)
  cmake_parse_arguments(ROOM "" "" "USES;TESTS;PUBLIC;PRIVATE" ${ARGN})
  file(GLOB SOURCES CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/*.cpp)
  set(TESTS ${SOURCES})
  list(FILTER TESTS INCLUDE REGEX "_test\\.cpp$")
  list(FILTER SOURCES EXCLUDE REGEX "_test\\.cpp$")

  if(NOT SOURCES)
    file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/empty.cpp "")
    set(SOURCES ${CMAKE_CURRENT_BINARY_DIR}/empty.cpp)
  endif()

  set(TARGET tileflight_${NAME})
  set(ROOMS ${ROOM_USES})
  list(TRANSFORM ROOMS PREPEND "tileflight::")
  add_library(${TARGET} STATIC ${SOURCES})
  add_library(tileflight::${NAME} ALIAS ${TARGET})
  target_include_directories(${TARGET} PUBLIC ${CMAKE_SOURCE_DIR})
  target_link_libraries(${TARGET}
    PUBLIC ${ROOMS} ${ROOM_PUBLIC}
    PRIVATE ${ROOM_PRIVATE} tileflight_compiler)

  # What reads foreign bytes tells the fuzzer which ways it took.
  set(FUZZED base geometry imaging rpc transport tile_contents tiles flight_logs tiling)
  if(TILEFLIGHT_FUZZ AND NAME IN_LIST FUZZED)
    target_compile_options(${TARGET} PRIVATE -fsanitize=fuzzer-no-link)
  endif()

  if(TESTS)
    add_executable(${NAME}_test ${TESTS})
    list(TRANSFORM ROOM_TESTS PREPEND "tileflight::")
    target_link_libraries(${NAME}_test PRIVATE tileflight::${NAME} ${ROOM_TESTS} ${ROOM_PRIVATE} tileflight_compiler
                          GTest::gmock GTest::gtest_main)
    target_compile_definitions(${NAME}_test PRIVATE TILEFLIGHT_SOURCE_DIR="${CMAKE_SOURCE_DIR}")
    set(PLAIN imaging transport tile_contents tiles dataset report)
    if(NAME IN_LIST PLAIN)
      target_link_libraries(${NAME}_test PRIVATE tileflight_plain_tests)
    endif()
    tileflight_add_gtest(${NAME}_test ${NAME})
  endif()
endfunction()

# Registers each case of a GoogleTest program with ctest as PREFIX.Suite.Case; a skipped case counts as skipped.
function(tileflight_add_gtest TARGET PREFIX)
  gtest_discover_tests(${TARGET}
    TEST_PREFIX "${PREFIX}."
    DISCOVERY_MODE PRE_TEST
    DISCOVERY_TIMEOUT 60
    WORKING_DIRECTORY ${CMAKE_BINARY_DIR}
    PROPERTIES TIMEOUT 600 SKIP_REGULAR_EXPRESSION "\\[  SKIPPED \\]")
endfunction()
