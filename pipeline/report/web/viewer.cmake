# Sets EMMETROPE_HAS_VIEWER and EMMETROPE_VIEWER_FILE: the viewer library from npm, exactly as web/package-lock.json says.
# Without npm or network the report is complete but for the interactive viewer, and says so.
set(EMMETROPE_HAS_VIEWER 0)
set(EMMETROPE_VIEWER_FILE ${CMAKE_CURRENT_BINARY_DIR}/web/node_modules/@niivue/niivue/dist/niivue.umd.js)
find_program(NPM_PROGRAM npm)
if(NOT EXISTS ${EMMETROPE_VIEWER_FILE} AND NPM_PROGRAM)
  message(STATUS "Installing the report's viewer by npm")
  file(COPY web/package.json web/package-lock.json DESTINATION ${CMAKE_CURRENT_BINARY_DIR}/web)
  execute_process(COMMAND ${NPM_PROGRAM} ci --ignore-scripts --no-audit --no-fund
                          --fetch-retries=1 --fetch-timeout=20000
                  WORKING_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/web TIMEOUT 120
                  OUTPUT_QUIET ERROR_QUIET RESULT_VARIABLE npm_result)
  if(NOT npm_result EQUAL 0)
    message(STATUS "npm could not install it: the report will have no interactive viewer")
  endif()
endif()
if(EXISTS ${EMMETROPE_VIEWER_FILE})
  set(EMMETROPE_HAS_VIEWER 1)
endif()
configure_file(viewer_library.cpp.in ${CMAKE_CURRENT_BINARY_DIR}/viewer_library.cpp @ONLY)
