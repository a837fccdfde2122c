# Writes OUTPUT, a header that says which commit of SOURCE is built; empty outside of a repository.
execute_process(COMMAND git -C ${SOURCE} describe --always --dirty --abbrev=10
  OUTPUT_VARIABLE BUILD_COMMIT OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
file(CONFIGURE OUTPUT ${OUTPUT} @ONLY
  CONTENT "#pragma once\n\n#define HARCO_BUILD_COMMIT \"@BUILD_COMMIT@\"\n")
