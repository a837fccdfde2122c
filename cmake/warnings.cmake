# Strict warnings for our own code, in g++ and clang alike.
add_library(harco_warnings INTERFACE)
target_compile_options(harco_warnings INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wsign-conversion -Wnon-virtual-dtor
  -Wold-style-cast -Woverloaded-virtual -Wdouble-promotion -Wformat=2
  $<$<BOOL:${HARCO_WERROR}>:-Werror>)
