// OpenCV, loaded when it is first needed.
//
// OpenCV's libraries take a good part of a second to start, longer than most of what the command
// does. All that needs them is compiled into a module of its own, harco_opencv.so. To add to it:
// put a source file into the target harco_opencv, export a function from it with
// HARCO_OPENCV_EXPORT, and call it here by its name:
//
//   // in the module:   HARCO_OPENCV_EXPORT void harco_blur(Image& image) { ... }
//   // in the command:  opencv_function<void(Image&)>("harco_blur")(image);
#pragma once

#include "module.hpp"

#define HARCO_OPENCV_EXPORT HARCO_MODULE_EXPORT

namespace harco::cli {

template <typename Function>
Function* opencv_function(const char* name) {
  return reinterpret_cast<Function*>(module_symbol("harco_opencv.so", name));
}

}  // namespace harco::cli
