// OpenCV, loaded when it is first needed.
//
// OpenCV's libraries take a good part of a second to start, longer than most of what the command
// does. All that needs them is compiled into a module of its own, harco_opencv.so, which lies
// beside the command (or in lib/harco where it is installed). To add to it: put a source file into
// the target harco_opencv, export a function from it with HARCO_OPENCV_EXPORT, and call it here by
// its name:
//
//   // in the module:   HARCO_OPENCV_EXPORT void harco_blur(Image& image) { ... }
//   // in the command:  opencv_function<void(Image&)>("harco_blur")(image);
//
// The module and the command are always built together and may pass C++ types and exceptions.
#pragma once

#define HARCO_OPENCV_EXPORT extern "C" __attribute__((visibility("default")))

namespace harco::cli {

/// Address of a function of the module. Throws Error, naming the module, if it can't be loaded.
void* opencv_symbol(const char* name);

template <typename Function>
Function* opencv_function(const char* name) {
  return reinterpret_cast<Function*>(opencv_symbol(name));
}

}  // namespace harco::cli
