# Writes the program's version, "0.1.0+<commit>[-dirty]", into OUTPUT when it differs from what stands there.
execute_process(COMMAND git describe --always --dirty WORKING_DIRECTORY ${SOURCE} OUTPUT_VARIABLE commit
                OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
if(NOT commit)
  set(commit release)
endif()
file(CONFIGURE OUTPUT ${OUTPUT} CONTENT "#pragma once\n#define EMMETROPE_VERSION \"${VERSION}+${commit}\"\n")
