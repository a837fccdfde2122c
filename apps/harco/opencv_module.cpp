#include "opencv_module.hpp"

#include <dlfcn.h>

#include <array>
#include <filesystem>
#include <string>
#include <system_error>

#include "harco/error.hpp"

namespace harco::cli {
namespace {

constexpr const char* kFile = "harco_opencv.so";

std::filesystem::path folder_of_command() {
  std::error_code failed;
  const std::filesystem::path command = std::filesystem::read_symlink("/proc/self/exe", failed);
  if (failed) throw Error(std::string(kFile) + ": can't tell where the command itself lies");
  return command.parent_path();
}

/// Beside the command in a build tree, in lib/harco once installed.
std::filesystem::path find_module() {
  const std::filesystem::path here = folder_of_command();
  const std::array<std::filesystem::path, 2> places{here / kFile,
                                                    here / HARCO_MODULE_FOLDER / kFile};
  for (const std::filesystem::path& place : places) {
    std::error_code ignored;
    if (std::filesystem::exists(place, ignored)) return place.lexically_normal();
  }
  throw Error(places[1].lexically_normal().string() +
              ": is missing; it belongs to the harco command and holds all that needs OpenCV");
}

void* load() {
  const std::filesystem::path file = find_module();
  if (void* module = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL)) return module;
  const char* why = dlerror();
  throw Error(file.string() + ": can't be loaded (" + (why != nullptr ? why : "unknown") + ")");
}

}  // namespace

void* opencv_symbol(const char* name) {
  static void* const module = load();
  if (void* symbol = dlsym(module, name)) return symbol;
  throw Error(std::string(kFile) + ": has no function " + name +
              "; it is not of the same version as the command");
}

}  // namespace harco::cli
