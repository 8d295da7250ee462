# Warnings, sanitizers, linker and the floating-point rules that every target shares.

add_library(tileflight_compiler INTERFACE)
# Designated initialisers name what differs from the default; the rest is meant to be left out.
target_compile_options(tileflight_compiler INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wno-missing-field-initializers)
if(CMAKE_CXX_COMPILER_ID STREQUAL Clang)
  target_compile_options(tileflight_compiler INTERFACE -Wno-unknown-warning-option)
endif()
# GCC 12 takes `text + std::string` for an overlapping copy where it inlines more (GCC bug 105651, mended in 13).
target_compile_options(tileflight_compiler INTERFACE
  $<$<AND:$<CONFIG:Release>,$<CXX_COMPILER_ID:GNU>,$<VERSION_LESS:$<CXX_COMPILER_VERSION>,13>>:-Wno-restrict>)
if(CMAKE_UNITY_BUILD)  # these warn of names that are right in one file and clash only beside another
  target_compile_options(tileflight_compiler INTERFACE -Wno-shadow -Wno-subobject-linkage)
endif()
if(TILEFLIGHT_WARNINGS_AS_ERRORS)
  target_compile_options(tileflight_compiler INTERFACE -Werror)
endif()

# A fused multiply-add rounds once where two instructions round twice, so that results would differ from one machine to
# the next. Determinism is worth more than the few per cent. The flag is public: code that includes our headers has it, too.
set(TILEFLIGHT_RESULT_OPTIONS -ffp-contract=off)

if(TILEFLIGHT_SANITIZE STREQUAL thread)
  add_compile_options(-fsanitize=thread -fno-omit-frame-pointer)
  add_link_options(-fsanitize=thread)
elseif(TILEFLIGHT_SANITIZE)
  # Some checks only report what the address sanitizer or the processor stops at anyway. They would make half of the code.
  add_compile_options(-fsanitize=address,undefined -fno-sanitize=null,object-size,vptr -fno-sanitize-recover=undefined
                      -fno-omit-frame-pointer)
  add_link_options(-fsanitize=address,undefined)
endif()
if(TILEFLIGHT_SANITIZE AND CMAKE_CXX_COMPILER_ID STREQUAL Clang)
  # Relative to the folder in which compilers run, as the paths below.
  file(RELATIVE_PATH SANITIZER_IGNORE ${PROJECT_BINARY_DIR} ${PROJECT_SOURCE_DIR}/cmake/sanitizer-ignore.txt)
  add_compile_options(-fsanitize-ignorelist=${SANITIZER_IGNORE})
endif()

if(TILEFLIGHT_COVERAGE)
  # Counters are shared by threads. Nothing is inlined, so that each line counts for itself.
  add_compile_options(--coverage -fprofile-update=atomic -fno-inline)
  add_link_options(--coverage)
  add_custom_target(coverage
    COMMAND ${PROJECT_SOURCE_DIR}/.ci/coverage ${PROJECT_BINARY_DIR}
    USES_TERMINAL)
endif()

# Most tests take longer to compile than to run. Tests that compute little are not optimised. The others must be: where a
# test and its library instantiate the same template, the linker may keep the test's code.
add_library(tileflight_plain_tests INTERFACE)
target_compile_options(tileflight_plain_tests INTERFACE $<$<NOT:$<CONFIG:Release>>:-O0>)

# Code that no user waits for is compiled quickly in a Release build: -O3 takes three times as long as -O1.
add_library(tileflight_quickly_compiled INTERFACE)
target_compile_options(tileflight_quickly_compiled INTERFACE $<$<CONFIG:Release>:-O1>)

# Programs of the sanitizers are large: the default linker takes four times as long. Not with GCC: it emits functions of no
# bytes, and LLD's table of unwinding then lacks the function that follows at the same address, so that an exception that
# passes through it ends the program.
find_program(TILEFLIGHT_LLD ld.lld)
if(TILEFLIGHT_LLD AND CMAKE_CXX_COMPILER_ID MATCHES Clang)
  add_link_options(-fuse-ld=lld)
endif()

# Assertions and tests name their file: without the folder of the clone, so that all clones compile the same text and ccache
# knows it.
add_compile_options(-fmacro-prefix-map=${PROJECT_SOURCE_DIR}/=)
find_program(CCACHE ccache)
if(CCACHE)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CCACHE})
endif()
