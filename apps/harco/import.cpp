#include <CLI/CLI.hpp>

#include "verbs.hpp"

namespace harco::cli {

void add_import(CLI::App& app) { app.add_subcommand("import"); }

}  // namespace harco::cli
