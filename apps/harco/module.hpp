// Parts of the command that are loaded when they are first needed, because what they link takes
// long to start. Each lies beside the command, or in lib/harco where it is installed.
//
// A function that a module exports is declared extern "C" with HARCO_MODULE_EXPORT and called by
// its name. The modules and the command are always built together and may pass C++ types and
// exceptions.
#pragma once

#define HARCO_MODULE_EXPORT extern "C" __attribute__((visibility("default")))

namespace harco::cli {

/// Address of a function of the module in this file. Throws Error, naming the module, if it can't
/// be loaded.
void* module_symbol(const char* file, const char* name);

}  // namespace harco::cli
