# Makes FOLDER/page_script.cpp from the sources in WEB, with NPM and NODE (see web.cmake).

function(without_view WHY)
  message("The report will have no interactive view: ${WHY}. Delete ${FOLDER} and build again to try once more.")
  file(WRITE ${FOLDER}/page_script.cpp [[
#include "tileflight/experiments/report/page_script.h"

namespace tileflight::report {
std::string_view page_script() { return {}; }
std::string_view view_style() { return {}; }
}  // namespace tileflight::report
]])
endfunction()

file(MAKE_DIRECTORY ${FOLDER})
if(NOT NPM OR NOT NODE)
  without_view("there is no npm or no node here")
  return()
endif()

# Packages stay as long as the lock file is the same; a build after the first one needs no network.
file(SHA256 ${WEB}/package-lock.json LOCK)
set(FETCHED "")
if(EXISTS ${FOLDER}/fetched)
  file(READ ${FOLDER}/fetched FETCHED)
endif()
file(COPY ${WEB}/package.json ${WEB}/package-lock.json ${WEB}/build.mjs DESTINATION ${FOLDER})
file(REMOVE_RECURSE ${FOLDER}/src)
file(COPY ${WEB}/src DESTINATION ${FOLDER})
if(NOT FETCHED STREQUAL LOCK)
  execute_process(COMMAND ${NPM} ci --prefer-offline --ignore-scripts --no-audit --no-fund
                  WORKING_DIRECTORY ${FOLDER} RESULT_VARIABLE RESULT OUTPUT_QUIET ERROR_VARIABLE ERRORS TIMEOUT 300)
  if(NOT RESULT EQUAL 0)
    string(REGEX MATCH "npm (error|ERR!)[^\n]*" LINE "${ERRORS}")
    without_view("npm could not fetch its packages (${RESULT} ${LINE})")
    return()
  endif()
  file(WRITE ${FOLDER}/fetched ${LOCK})
endif()

# A fault in the project's own sources fails the build.
execute_process(COMMAND ${NODE} build.mjs page_script.cpp WORKING_DIRECTORY ${FOLDER} RESULT_VARIABLE RESULT)
if(NOT RESULT EQUAL 0)
  message(FATAL_ERROR "esbuild could not bundle web/src")
endif()
