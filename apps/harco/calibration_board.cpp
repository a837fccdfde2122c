#include "calibration_board.hpp"

#include <charconv>
#include <optional>
#include <utility>

#include "harco/error.hpp"

namespace harco::cli {
namespace {

/// "9x6".
std::optional<std::pair<int, int>> parse_size(const std::string& text) {
  const std::size_t cross = text.find('x');
  if (cross == std::string::npos) return std::nullopt;
  const auto whole = [](const char* begin, const char* end) {
    int value = 0;
    const auto [rest, error] = std::from_chars(begin, end, value);
    return error == std::errc() && rest == end && value >= 1 && value <= 1000 ? value : 0;
  };
  const char* begin = text.data();
  const int columns = whole(begin, begin + cross);
  const int rows = whole(begin + cross + 1, begin + text.size());
  if (columns == 0 || rows == 0) return std::nullopt;
  return std::pair(columns, rows);
}

}  // namespace

Board parse_board(const std::string& text) {
  const std::string wrong =
      "--board " + text +
      ": is neither chessboard:COLUMNSxROWS (inner corners, as in chessboard:9x6) "
      "nor charuco:COLUMNSxROWS:DICTIONARY (squares, as in charuco:7x5:4x4_50)";
  const std::size_t colon = text.find(':');
  if (colon == std::string::npos) throw Error(wrong);
  const std::string kind = text.substr(0, colon);
  const std::size_t second = text.find(':', colon + 1);
  const auto size = parse_size(text.substr(colon + 1, second - colon - 1));
  if (!size) throw Error(wrong);
  Board board;
  board.columns = size->first;
  board.rows = size->second;
  const bool named = second != std::string::npos && second + 1 < text.size();
  if (kind == "chessboard" && second == std::string::npos) {
    if (board.columns < 3 || board.rows < 3)
      throw Error("--board " + text + ": a chessboard has at least 3 x 3 inner corners");
    return board;
  }
  if (kind != "charuco" || !named) throw Error(wrong);
  if (board.columns < 3 || board.rows < 3)
    throw Error("--board " + text + ": a ChArUco board has at least 3 x 3 squares");
  board.kind = Board::Kind::charuco;
  board.dictionary = text.substr(second + 1);
  opencv_function<decltype(harco_check_board)>("harco_check_board")(board);
  return board;
}

std::vector<BoardCorner> find_board(const Board& board, const ImageView& image) {
  std::vector<BoardCorner> corners;
  opencv_function<decltype(harco_find_board)>("harco_find_board")(board, image, corners);
  return corners;
}

Camera rough_calibration(const std::vector<TargetView>& views, CalibrationModel model, int width,
                         int height) {
  Camera camera;
  opencv_function<decltype(harco_rough_calibration)>("harco_rough_calibration")(views, model, width,
                                                                                height, camera);
  return camera;
}

}  // namespace harco::cli
