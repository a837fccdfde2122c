#include "families.hpp"

namespace harco::cli {

Family load_family(const std::string& name) {
  Family family;
  opencv_function<decltype(harco_load_family)>("harco_load_family")(name, family);
  return family;
}

}  // namespace harco::cli
