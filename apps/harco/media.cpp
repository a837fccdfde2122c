#include "media.hpp"

#include "opencv_module.hpp"

namespace harco::cli {

const Media& media() {
  static const Media& instance = *opencv_function<const Media*()>("harco_opencv_media")();
  return instance;
}

}  // namespace harco::cli
