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
# An executable loads the libraries that it uses, not all that its parts could use.
target_link_options(emmetrope_compile INTERFACE -Wl,--as-needed)

# emmetrope_sources(VARIABLE FOLDER ...): every .cpp directly in the folders but mains, relative to the current one
function(emmetrope_sources variable)
  set(found)
  foreach(folder ${ARGN})
    file(GLOB in_folder CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${folder}/*.cpp)
    list(FILTER in_folder EXCLUDE REGEX "main\\.cpp$")
    list(APPEND found ${in_folder})
  endforeach()
  set(${variable} ${found} PARENT_SCOPE)
endfunction()

# emmetrope_library(NAME FOLDERS ... [SOURCES ...] LINK ... PRIVATE ... [NO_PCH])
#   FOLDERS: all their sources belong to the library
#   LINK:    our libraries and light ones, seen by users of the headers
#   PRIVATE: heavy libraries (VTK, CGAL, OpenCV, DCMTK), seen only by the .cpp files that adapt them
function(emmetrope_library name)
  cmake_parse_arguments(ARG "NO_PCH" "" "FOLDERS;SOURCES;LINK;PRIVATE" ${ARGN})
  emmetrope_sources(sources ${ARG_FOLDERS})
  add_library(${name} STATIC ${sources} ${ARG_SOURCES})
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
