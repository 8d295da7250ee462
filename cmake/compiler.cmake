# Warnings, sanitizers, linker and the floating-point rules that every target shares.

add_library(tileflight_compiler INTERFACE)
# Designated initialisers name what differs from the default; the rest is meant to be left out.
target_compile_options(tileflight_compiler INTERFACE -Wall -Wextra -Wpedantic -Wshadow -Wno-missing-field-initializers)
if(TILEFLIGHT_WARNINGS_AS_ERRORS)
  target_compile_options(tileflight_compiler INTERFACE -Werror)
endif()

# A fused multiply-add rounds once where two instructions round twice: results would differ from
# one machine to the next. Determinism is worth more than the few per cent.
add_compile_options(-ffp-contract=off)

if(TILEFLIGHT_SANITIZE)
  add_compile_options(-fsanitize=address,undefined -fno-sanitize-recover=undefined -fno-omit-frame-pointer)
  add_link_options(-fsanitize=address,undefined)
endif()

if(TILEFLIGHT_FUZZ)
  add_compile_options(-fsanitize=fuzzer-no-link,address,undefined -fno-sanitize-recover=undefined)
  add_link_options(-fsanitize=address,undefined)
endif()

find_program(CCACHE ccache)
if(CCACHE)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CCACHE})
endif()
