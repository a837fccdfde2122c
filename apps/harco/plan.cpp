#include <CLI/CLI.hpp>

#include "verbs.hpp"

namespace harco::cli {

void add_plan(CLI::App& app) { app.add_subcommand("plan"); }

}  // namespace harco::cli
