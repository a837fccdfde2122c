#include "module.hpp"

#include <dlfcn.h>

#include <array>
#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <system_error>

#include "harco/error.hpp"

namespace harco::cli {
namespace {

std::filesystem::path folder_of_command(const std::string& file) {
  std::error_code failed;
  const std::filesystem::path command = std::filesystem::read_symlink("/proc/self/exe", failed);
  if (failed) throw Error(file + ": can't tell where the command itself lies");
  return command.parent_path();
}

/// Beside the command in a build tree, in lib/harco once installed.
std::filesystem::path find_module(const std::string& file) {
  const std::filesystem::path here = folder_of_command(file);
  const std::array<std::filesystem::path, 2> places{here / file, here / HARCO_MODULE_FOLDER / file};
  for (const std::filesystem::path& place : places) {
    std::error_code ignored;
    if (std::filesystem::exists(place, ignored)) return place.lexically_normal();
  }
  throw Error(places[1].lexically_normal().string() +
              ": is missing; it is a part of the harco command");
}

void* load(const std::string& name) {
  const std::filesystem::path file = find_module(name);
  if (void* module = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL)) return module;
  const char* why = dlerror();
  throw Error(file.string() + ": can't be loaded (" + (why != nullptr ? why : "unknown") + ")");
}

}  // namespace

void* module_symbol(const char* file, const char* name) {
  static std::mutex mutex;
  static std::map<std::string, void*> loaded;
  const std::lock_guard lock(mutex);
  const auto known = loaded.find(file);
  void* const module = known != loaded.end() ? known->second : loaded[file] = load(file);
  if (void* symbol = dlsym(module, name)) return symbol;
  throw Error(std::string(file) + ": has no function " + name +
              "; it is not of the same version as the command");
}

}  // namespace harco::cli
