// Runs the harco command as a user does. Tests that include it are listed with harco_verb_test().
#pragma once

#include <string>

#include "shell.hpp"

namespace harco::test {

/// Runs `harco ARGUMENTS` through the shell.
inline CommandResult run_harco(const std::string& arguments) {
  return run_shell(std::string("'") + HARCO_COMMAND + "' " + arguments);
}

}  // namespace harco::test
