# tileflight_page_script(OUTPUT)
#
# Sets OUTPUT to a C++ source, made at build time, that holds the interactive view of the report (web/), bundled by
# esbuild. npm fetches what package-lock.json names, into the build folder and once. Where there is no npm, or it cannot
# fetch, the source holds nothing, the build says so, and reports show pictures only.
find_program(NPM npm)
find_program(NODE node)

function(tileflight_page_script OUTPUT)
  set(FOLDER ${PROJECT_BINARY_DIR}/web)
  file(GLOB SOURCES CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/web/src/*)
  set(SETTINGS ${PROJECT_SOURCE_DIR}/web/package.json ${PROJECT_SOURCE_DIR}/web/package-lock.json
               ${PROJECT_SOURCE_DIR}/web/build.mjs ${PROJECT_SOURCE_DIR}/cmake/bundle_web.cmake)
  add_custom_command(OUTPUT ${FOLDER}/page_script.cpp
    COMMAND ${CMAKE_COMMAND} -D WEB=${PROJECT_SOURCE_DIR}/web -D FOLDER=${FOLDER} -D NPM=${NPM} -D NODE=${NODE}
            -P ${PROJECT_SOURCE_DIR}/cmake/bundle_web.cmake
    DEPENDS ${SOURCES} ${SETTINGS}
    COMMENT "Bundling the report's view"
    VERBATIM)
  set(${OUTPUT} ${FOLDER}/page_script.cpp PARENT_SCOPE)
endfunction()
