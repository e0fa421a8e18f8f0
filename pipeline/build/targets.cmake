# How every library, executable and test of the project is declared; warnings, precompiled header and ccache in one place.

find_program(CCACHE_PROGRAM ccache)
if(CCACHE_PROGRAM)
  # ccache needs to be told that a precompiled header's defines and time stamps are no reason to miss.
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env
      CCACHE_SLOPPINESS=pch_defines,time_macros,include_file_mtime,include_file_ctime ${CCACHE_PROGRAM})
endif()

option(EMMETROPE_WARNINGS_AS_ERRORS "For developers and CI" OFF)

# Interface target: what every target of ours compiles with. -pthread everywhere, as some libraries ask for it and a
# precompiled header serves only where the same is defined.
add_library(emmetrope_compile INTERFACE)
set(warnings -Wall -Wextra -Wpedantic -Wnon-virtual-dtor -Woverloaded-virtual)
if(NOT CMAKE_UNITY_BUILD)
  list(APPEND warnings -Wshadow)  # in a batch one source's names would shadow another's
endif()
if(EMMETROPE_WARNINGS_AS_ERRORS)
  list(APPEND warnings -Werror)
endif()
target_compile_features(emmetrope_compile INTERFACE cxx_std_17)
# Position-independent, as the libraries also go into the Python module; as an option and not a property, so that
# programs and libraries share one precompiled header.
target_compile_options(emmetrope_compile INTERFACE -pthread
  "$<BUILD_INTERFACE:${warnings};-fpch-preprocess;-fPIC;-fno-semantic-interposition>")
# Files of unknown origin are read: tests/end_to_end/installed_tree.sh looks at what comes of it.
include(CheckCXXCompilerFlag)
set(hardening -fstack-protector-strong -fstack-clash-protection
  "$<$<CONFIG:Release>:-U_FORTIFY_SOURCE;-D_FORTIFY_SOURCE=2>")
check_cxx_compiler_flag(-fcf-protection=full EMMETROPE_HAS_CONTROL_FLOW_PROTECTION)
check_cxx_compiler_flag(-mbranch-protection=standard EMMETROPE_HAS_BRANCH_PROTECTION)
if(EMMETROPE_HAS_CONTROL_FLOW_PROTECTION)
  list(APPEND hardening -fcf-protection=full)
elseif(EMMETROPE_HAS_BRANCH_PROTECTION)
  list(APPEND hardening -mbranch-protection=standard)
endif()
target_compile_options(emmetrope_compile INTERFACE "$<BUILD_INTERFACE:${hardening}>")
target_include_directories(emmetrope_compile INTERFACE
  $<BUILD_INTERFACE:${CMAKE_SOURCE_DIR}> $<INSTALL_INTERFACE:include/emmetrope>)
install(TARGETS emmetrope_compile EXPORT emmetrope COMPONENT development)
# An executable loads the libraries that it uses, not all that its parts could use.
target_link_options(emmetrope_compile INTERFACE -Wl,--as-needed "$<BUILD_INTERFACE:-Wl,-z,relro,-z,now>")

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

# emmetrope_public(NAME FOLDERS ...): the library is installed for other programs, with the headers of these folders, as
# the target emmetrope::NAME without its prefix (find_package(emmetrope))
function(emmetrope_public name)
  cmake_parse_arguments(ARG "" "" "FOLDERS" ${ARGN})
  string(REPLACE emmetrope_ "" exported ${name})
  set_target_properties(${name} PROPERTIES EXPORT_NAME ${exported})
  install(TARGETS ${name} EXPORT emmetrope ARCHIVE DESTINATION lib/emmetrope COMPONENT development)
  foreach(folder ${ARG_FOLDERS})
    install(DIRECTORY ${CMAKE_SOURCE_DIR}/${folder} DESTINATION include/emmetrope/${folder}/..
            COMPONENT development FILES_MATCHING PATTERN *.hpp)
  endforeach()
endfunction()

# emmetrope_executable(NAME SOURCES main.cpp LINK library): a thin main, installed to bin/
add_custom_target(programs)
function(emmetrope_executable name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINK" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_link_libraries(${name} PRIVATE ${ARG_LINK})
  target_precompile_headers(${name} REUSE_FROM emmetrope_base)
  add_dependencies(programs ${name})
  set_property(GLOBAL APPEND PROPERTY EMMETROPE_PROGRAMS ${name})
  install(TARGETS ${name} RUNTIME DESTINATION bin COMPONENT programs)
endfunction()

# emmetrope_embed(TARGET VARIABLE FILE): the text of FILE as `extern const char VARIABLE[]` in namespace emmetrope
function(emmetrope_embed target variable file)
  get_filename_component(file ${file} ABSOLUTE)
  set(output ${CMAKE_CURRENT_BINARY_DIR}/${variable}.cpp)
  add_custom_command(OUTPUT ${output}
    COMMAND ${CMAKE_COMMAND} -DINPUT=${file} -DOUTPUT=${output}
            -DVARIABLE=${variable} -P ${CMAKE_SOURCE_DIR}/pipeline/build/embed.cmake
    DEPENDS ${file} ${CMAKE_SOURCE_DIR}/pipeline/build/embed.cmake
    COMMENT "Embedding ${variable}")
  target_sources(${target} PRIVATE ${output})
  set_source_files_properties(${output} PROPERTIES SKIP_PRECOMPILE_HEADERS ON)
endfunction()
