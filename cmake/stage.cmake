# tileflight_stage(NAME [USES stage...] [PUBLIC lib...] [PRIVATE lib...])
#
# Makes the library of a stage from the folder's *.cpp, and its test program from the folder's *_test.cpp.
# USES names the stages whose headers this one may include (docs/architecture.md); PUBLIC are libraries that
# its headers show, PRIVATE those that only its sources need.
include(GoogleTest)

function(tileflight_stage NAME)
  cmake_parse_arguments(STAGE "" "" "USES;PUBLIC;PRIVATE" ${ARGN})
  file(GLOB SOURCES CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/*.cpp)
  set(TESTS ${SOURCES})
  list(FILTER TESTS INCLUDE REGEX "_test\\.cpp$")
  list(FILTER SOURCES EXCLUDE REGEX "_test\\.cpp$")

  if(NOT SOURCES)
    file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/empty.cpp "")
    set(SOURCES ${CMAKE_CURRENT_BINARY_DIR}/empty.cpp)
  endif()

  set(TARGET tileflight_${NAME})
  set(STAGES ${STAGE_USES})
  list(TRANSFORM STAGES PREPEND "tileflight::")
  add_library(${TARGET} STATIC ${SOURCES})
  add_library(tileflight::${NAME} ALIAS ${TARGET})
  target_include_directories(${TARGET} PUBLIC ${CMAKE_SOURCE_DIR})
  target_link_libraries(${TARGET}
    PUBLIC ${STAGES} ${STAGE_PUBLIC}
    PRIVATE ${STAGE_PRIVATE} tileflight_compiler)

  # What reads foreign bytes tells the fuzzer which ways it took.
  set(FUZZED geometry imaging rpc tiles flight tiling)
  if(TILEFLIGHT_FUZZ AND NAME IN_LIST FUZZED)
    target_compile_options(${TARGET} PRIVATE -fsanitize=fuzzer-no-link)
  endif()

  if(TESTS)
    add_executable(${NAME}_test ${TESTS})
    target_link_libraries(${NAME}_test PRIVATE tileflight::${NAME} ${STAGE_PRIVATE} tileflight_compiler
                          GTest::gmock GTest::gtest_main)
    target_compile_definitions(${NAME}_test PRIVATE TILEFLIGHT_SOURCE_DIR="${CMAKE_SOURCE_DIR}")
    set(PLAIN imaging tiles dataset report)
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
