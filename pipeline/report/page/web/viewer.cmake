# The viewer library from npm, exactly as page/web/package-lock.json says. Without npm or network the report is complete but
# for the interactive viewer, and says so.
include(${CMAKE_SOURCE_DIR}/pipeline/build/npm.cmake)
emmetrope_npm(page/web @niivue/niivue/dist/niivue.umd.js EMMETROPE_VIEWER_FILE)
set(EMMETROPE_HAS_VIEWER 0)
if(EMMETROPE_VIEWER_FILE)
  set(EMMETROPE_HAS_VIEWER 1)
endif()
configure_file(page/viewer_library.cpp.in ${CMAKE_CURRENT_BINARY_DIR}/viewer_library.cpp @ONLY)

# The plots of the living eye; without them it says its figures in words.
emmetrope_npm(page/web uplot/dist/uPlot.iife.min.js EMMETROPE_PLOT_FILE)
emmetrope_npm(page/web uplot/dist/uPlot.min.css EMMETROPE_PLOT_STYLE)
if(NOT EMMETROPE_PLOT_FILE OR NOT EMMETROPE_PLOT_STYLE)
  set(EMMETROPE_PLOT_FILE ${CMAKE_CURRENT_BINARY_DIR}/no_plot)
  set(EMMETROPE_PLOT_STYLE ${EMMETROPE_PLOT_FILE})
  file(WRITE ${EMMETROPE_PLOT_FILE} "")
endif()
