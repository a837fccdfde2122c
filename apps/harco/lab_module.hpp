// The laboratory (lab/), loaded when it is first needed: simulation and experiments. To add to it:
// a source file in the target harco_lab_module that exports a function with HARCO_MODULE_EXPORT,
// and
//
//   lab_function<void(Image&)>("harco_lab_blur")(image);
#pragma once

#include "module.hpp"

namespace harco::cli {

template <typename Function>
Function* lab_function(const char* name) {
  return reinterpret_cast<Function*>(module_symbol("harco_lab.so", name));
}

}  // namespace harco::cli
