// A calibration for people and for programs.
#pragma once

#include <string>
#include <vector>

#include "calibration.hpp"
#include "calibration_verdict.hpp"

namespace harco::cli {

/// A picture that was looked at.
struct CalibrationPicture {
  std::string source;    ///< as output names it
  std::string left_out;  ///< why it plays no part, if it doesn't
};

struct CalibrationReport {
  CalibrationModel model = CalibrationModel::pinhole;
  std::vector<CalibrationPicture> pictures;
  std::vector<TargetView> views;
  Calibration calibration;
  Evidence evidence;
  Verdict verdict;
};

/// Some lines for a terminal, the verdict last.
std::string report_text(const CalibrationReport& report);

/// All of it as JSON.
std::string report_json(const CalibrationReport& report);

}  // namespace harco::cli
