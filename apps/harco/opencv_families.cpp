#include "families.hpp"

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <map>
#include <memory>
#include <stdexcept>
#include <utility>

#include <opencv2/aruco.hpp>
#include <opencv2/core/version.hpp>

#include <apriltag/apriltag.h>
#include <apriltag/tag16h5.h>
#include <apriltag/tag25h9.h>
#include <apriltag/tag36h10.h>
#include <apriltag/tag36h11.h>
#include <apriltag/tagCircle21h7.h>
#include <apriltag/tagCircle49h12.h>
#include <apriltag/tagCustom48h12.h>
#include <apriltag/tagStandard41h12.h>
#include <apriltag/tagStandard52h13.h>

#include "aruco_dictionary.hpp"

namespace harco::cli {
namespace {

const std::map<std::string, int>& aruco_dictionaries() {
  static const std::map<std::string, int> all {
    {"4x4_50", cv::aruco::DICT_4X4_50}, {"4x4_100", cv::aruco::DICT_4X4_100},
        {"4x4_250", cv::aruco::DICT_4X4_250}, {"4x4_1000", cv::aruco::DICT_4X4_1000},
        {"5x5_50", cv::aruco::DICT_5X5_50}, {"5x5_100", cv::aruco::DICT_5X5_100},
        {"5x5_250", cv::aruco::DICT_5X5_250}, {"5x5_1000", cv::aruco::DICT_5X5_1000},
        {"6x6_50", cv::aruco::DICT_6X6_50}, {"6x6_100", cv::aruco::DICT_6X6_100},
        {"6x6_250", cv::aruco::DICT_6X6_250}, {"6x6_1000", cv::aruco::DICT_6X6_1000},
        {"7x7_50", cv::aruco::DICT_7X7_50}, {"7x7_100", cv::aruco::DICT_7X7_100},
        {"7x7_250", cv::aruco::DICT_7X7_250}, {"7x7_1000", cv::aruco::DICT_7X7_1000},
        {"original", cv::aruco::DICT_ARUCO_ORIGINAL},
#if CV_VERSION_MAJOR > 4 || (CV_VERSION_MAJOR == 4 && CV_VERSION_MINOR >= 8)
        {"mip_36h12", cv::aruco::DICT_ARUCO_MIP_36h12},
#endif
  };
  return all;
}

/// A family of libapriltag and how to free it.
struct TagMaker {
  apriltag_family_t* (*create)();
  void (*destroy)(apriltag_family_t*);
};

const std::map<std::string, TagMaker>& tag_makers() {
  static const std::map<std::string, TagMaker> all{
      {"16h5", {tag16h5_create, tag16h5_destroy}},
      {"25h9", {tag25h9_create, tag25h9_destroy}},
      {"36h10", {tag36h10_create, tag36h10_destroy}},
      {"36h11", {tag36h11_create, tag36h11_destroy}},
      {"circle21h7", {tagCircle21h7_create, tagCircle21h7_destroy}},
      {"circle49h12", {tagCircle49h12_create, tagCircle49h12_destroy}},
      {"custom48h12", {tagCustom48h12_create, tagCustom48h12_destroy}},
      {"standard41h12", {tagStandard41h12_create, tagStandard41h12_destroy}},
      {"standard52h13", {tagStandard52h13_create, tagStandard52h13_destroy}}};
  return all;
}

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

std::string without(const std::string& prefix, const std::string& text) {
  return text.rfind(prefix, 0) == 0 ? text.substr(prefix.size()) : text;
}

std::vector<Code> aruco_codes(const std::string& name) {
  const auto dictionary = aruco_dictionary(name);
  const int n = dictionary->markerSize;
  std::vector<Code> codes;
  for (int id = 0; id < dictionary->bytesList.rows; ++id) {
    const cv::Mat bits =
        cv::aruco::Dictionary::getBitsFromByteList(dictionary->bytesList.row(id), n);
    Code code{n, 0};
    for (int cell = 0; cell < n * n; ++cell)
      code.bits |= std::uint64_t{bits.at<unsigned char>(cell / n, cell % n) != 0} << cell;
    codes.push_back(code);
  }
  return codes;
}

std::vector<Code> tag_codes(const std::string& name) {
  const auto found = tag_makers().find(without("tag", name));
  if (found == tag_makers().end())
    throw std::invalid_argument("apriltag:" + name +
                                ": no such family; there are apriltag:16h5, 25h9, 36h10, 36h11");
  const std::unique_ptr<apriltag_family_t, void (*)(apriltag_family_t*)> family{
      found->second.create(), found->second.destroy};
  const int n = family->width_at_border - 2;
  if (family->reversed_border || family->nbits != static_cast<std::uint32_t>(n * n))
    throw std::invalid_argument("apriltag:" + name +
                                ": has bits outside its border; only families that end in a "
                                "one-cell black border can be parents (16h5, 25h9, 36h10, 36h11)");
  std::vector<Code> codes;
  for (std::uint32_t id = 0; id < family->ncodes; ++id) {
    Code code{n, 0};
    // The most significant bit comes first; places are counted from the border's corner.
    for (std::uint32_t i = 0; i < family->nbits; ++i) {
      const auto column = static_cast<int>(family->bit_x[i]) - 1;
      const auto row = static_cast<int>(family->bit_y[i]) - 1;
      const std::uint64_t bit = (family->codes[id] >> (family->nbits - 1 - i)) & 1U;
      code.bits |= bit << (row * n + column);
    }
    codes.push_back(code);
  }
  return codes;
}

Family family_of(const std::string& name) {
  const std::string plain = lower(name);
  const std::size_t colon = plain.find(':');
  const std::string maker = plain.substr(0, colon);
  const std::string family = colon == std::string::npos ? "" : plain.substr(colon + 1);
  if (maker == "aruco") return {plain, aruco_codes(family)};
  if (maker == "apriltag") return {plain, tag_codes(family)};
  throw std::invalid_argument(
      "family '" + name +
      "': begins neither with aruco: nor with apriltag: (try aruco:4x4_50 or "
      "apriltag:36h11)");
}

}  // namespace

cv::Ptr<cv::aruco::Dictionary> aruco_dictionary(const std::string& name) {
  const auto found = aruco_dictionaries().find(without("aruco_", without("dict_", lower(name))));
  if (found == aruco_dictionaries().end()) {
    if (name == "mip_36h12")
      throw std::invalid_argument("aruco:mip_36h12: OpenCV " CV_VERSION
                                  " doesn't have it (OpenCV 4.8 and later do)");
    throw std::invalid_argument("aruco:" + name +
                                ": no such family; there are NxN_COUNT with N 4 … 7 and COUNT 50, "
                                "100, 250 or 1000 (aruco:4x4_50), and aruco:original");
  }
  return cv::aruco::getPredefinedDictionary(
      static_cast<cv::aruco::PREDEFINED_DICTIONARY_NAME>(found->second));
}

void harco_load_family(const std::string& name, Family& family) { family = family_of(name); }

}  // namespace harco::cli
