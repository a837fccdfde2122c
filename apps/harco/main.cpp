// harco: plan, generate and import markers, detect them.
#include <cstdio>
#include <exception>
#include <string>

#include <CLI/CLI.hpp>

#include "harco/version.hpp"
#include "verbs.hpp"

namespace {

constexpr int kBadInput = 2;

/// Whatever is wrong becomes one line on standard error.
int report(const std::string& what) {
  std::string line = what.substr(0, what.find('\n'));
  std::fprintf(stderr, "harco: %s\n", line.c_str());
  return kBadInput;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"HArCo: hierarchical fiducial markers, from plan to pose"};
  app.name("harco");
  app.set_version_flag("--version", "harco " HARCO_VERSION);
  app.require_subcommand(1);
  harco::cli::add_plan(app);
  harco::cli::add_generate(app);
  harco::cli::add_import(app);
  harco::cli::add_detect(app);
  harco::cli::add_calibrate(app);
  harco::cli::add_mount(app);
  harco::cli::add_simulate(app);
  harco::cli::add_land(app);
  harco::cli::add_replay(app);
  harco::cli::add_reproduce(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    if (argc > 1 && app.get_subcommands().empty())
      return report(std::string("there is no verb or option '") + argv[1] +
                    "' (harco --help lists them)");
    return report(error.what());
  } catch (const harco::cli::ExitStatus& exit) {
    return exit.status;
  } catch (const std::exception& error) {
    return report(error.what());
  }
  return 0;
}
