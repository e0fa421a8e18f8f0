# How every library, executable and test of the project is declared; warnings, precompiled header and ccache in one place.

find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM)
  # ccache needs to be told that a precompiled header's defines and time stamps are no reason to miss.
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env
      CCACHE_SLOPPINESS=pch_defines,time_macros,include_file_mtime,include_file_ctime ${CCACHE_PROGRAM})
endif()

# Interface target: what every target of ours compiles with.
add_library(emmetrope_compile INTERFACE)
target_compile_options(emmetrope_compile INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Woverloaded-virtual -Werror -fpch-preprocess)
target_include_directories(emmetrope_compile INTERFACE ${CMAKE_SOURCE_DIR})

# emmetrope_library(NAME SOURCES ... LINK ... PRIVATE ... [NO_PCH])
#   LINK:    our libraries and light ones, seen by users of the headers
#   PRIVATE: heavy libraries (VTK, CGAL, OpenCV, DCMTK), seen only by the .cpp files that adapt them
function(emmetrope_library name)
  cmake_parse_arguments(ARG "NO_PCH" "" "SOURCES;LINK;PRIVATE" ${ARGN})
  add_library(${name} STATIC ${ARG_SOURCES})
  target_link_libraries(${name} PUBLIC emmetrope_compile ${ARG_LINK} PRIVATE ${ARG_PRIVATE})
  if(name STREQUAL emmetrope_base)
    target_precompile_headers(${name} PRIVATE ${CMAKE_SOURCE_DIR}/pipeline/base/precompiled.hpp)
  elseif(NOT ARG_NO_PCH)
    target_precompile_headers(${name} REUSE_FROM emmetrope_base)
  endif()
endfunction()

# emmetrope_executable(NAME SOURCES main.cpp LINK library): a thin main, installed to bin/
function(emmetrope_executable name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LINK})
  install(TARGETS ${name} RUNTIME DESTINATION bin)
endfunction()

# emmetrope_test(NAME SOURCES ... LINK ... LABELS ... [TIMEOUT seconds]): GoogleTest cases, one CTest entry per case
function(emmetrope_test name)
  cmake_parse_arguments(ARG "" "TIMEOUT" "SOURCES;LINK;LABELS" ${ARGN})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 120)
  endif()
  add_executable(${name} ${ARG_SOURCES})
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/tests)
  target_link_libraries(${name} PRIVATE ${ARG_LINK} GTest::gmock GTest::gtest_main)
  gtest_discover_tests(${name} DISCOVERY_TIMEOUT 60
    PROPERTIES LABELS "${ARG_LABELS}" TIMEOUT ${ARG_TIMEOUT}
    ENVIRONMENT "EMMETROPE_BIN=${CMAKE_BINARY_DIR}/bin")
endfunction()

# emmetrope_embed(TARGET VARIABLE FILE): the text of FILE as `extern const char VARIABLE[]` in namespace emmetrope
function(emmetrope_embed target variable file)
  set(output ${CMAKE_CURRENT_BINARY_DIR}/${variable}.cpp)
  add_custom_command(OUTPUT ${output}
    COMMAND ${CMAKE_COMMAND} -DINPUT=${CMAKE_CURRENT_SOURCE_DIR}/${file} -DOUTPUT=${output}
            -DVARIABLE=${variable} -P ${CMAKE_SOURCE_DIR}/pipeline/build/embed.cmake
    DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${file} ${CMAKE_SOURCE_DIR}/pipeline/build/embed.cmake
    COMMENT "Embedding ${file}")
  target_sources(${target} PRIVATE ${output})
  set_source_files_properties(${output} PROPERTIES SKIP_PRECOMPILE_HEADERS ON)
endfunction()
