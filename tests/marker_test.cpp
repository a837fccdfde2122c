#include "harco/marker.hpp"

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "harco/error.hpp"
#include "sample_markers.hpp"
#include "shell.hpp"

namespace harco {
namespace {

using Json = nlohmann::json;
using test::code_with_black;
using test::three_layers;

// --- The tree in the plane ----------------------------------------------------------------------

TEST(Place, PositionsOfSection334) {
  const auto placed = place(three_layers());
  ASSERT_EQ(placed.size(), 4U);
  // Grid cell = side of a last-layer child = 1/49 of the parent. Cell 0 of the parent lies one
  // parent cell (7) right and down, as in the contract's example; cell 12 three of them (21).
  EXPECT_EQ(placed[0].grid_position, Eigen::Vector2d(0, 0));
  EXPECT_EQ(placed[1].grid_position, Eigen::Vector2d(7, 7));
  EXPECT_EQ(placed[2].grid_position, Eigen::Vector2d(21, 21));
  // Cell 24 of child 7: 7 + 5 cells of one grid unit.
  EXPECT_EQ(placed[3].grid_position, Eigen::Vector2d(12, 12));
}

TEST(Place, SidesLayersAndContainers) {
  const auto placed = place(three_layers());
  const std::vector<int> ids{0, 7, 3, 9};
  const std::vector<int> layers{1, 2, 2, 3};
  const std::vector<int> containers{-1, 0, 0, 1};
  const std::vector<int> cells{-1, 0, 12, 24};
  for (std::size_t i = 0; i < placed.size(); ++i) {
    EXPECT_EQ(placed[i].id, ids[i]);
    EXPECT_EQ(placed[i].layer, layers[i]);
    EXPECT_EQ(placed[i].container, containers[i]);
    EXPECT_EQ(placed[i].cell, cells[i]);
    EXPECT_NEAR(placed[i].side_m, 1.6 / std::pow(7.0, layers[i] - 1), 1e-15);
  }
  EXPECT_NEAR(placed[1].cell_side_m(), 1.6 / 49.0, 1e-15);
  EXPECT_EQ(three_layers().layers(), 3);
}

TEST(Place, RowsGoDownAndColumnsRight) {
  MarkerSet set = three_layers();
  set.parents[0].marker.children = {{1, 3, code_with_black({5, 6, 7}), {}}};
  // Cell 3 of 5 x 5: row 0, column 3; with the ring, 4 cells right and 1 down.
  const PlacedMarker child = place(set).at(1);
  EXPECT_NEAR(child.origin_m.x(), 4 * 1.6 / 7, 1e-12);
  EXPECT_NEAR(child.origin_m.y(), 1 * 1.6 / 7, 1e-12);
  EXPECT_EQ(child.grid_position, Eigen::Vector2d(4, 1));
}

TEST(Place, CornersRunClockwiseFromTheTopLeft) {
  const auto corners = place(three_layers())[0].corners_m();
  EXPECT_EQ(corners[0], Eigen::Vector2d(0.0, 0.0));
  EXPECT_EQ(corners[1], Eigen::Vector2d(1.6, 0.0));
  EXPECT_EQ(corners[2], Eigen::Vector2d(1.6, 1.6));
  EXPECT_EQ(corners[3], Eigen::Vector2d(0.0, 1.6));
}

TEST(Place, ParentsFollowOneAnotherWithAGridOfTheirOwn) {
  MarkerSet set = three_layers();
  // A parent of 6 x 6 cells with one child: its grid unit is its own child's side, 1/8 of it.
  set.parents.push_back(
      {0.8, {1, -1, code_with_black({1, 2, 6}, 6), {{4, 7, code_with_black({5, 6, 8}), {}}}}});
  validate(set);
  const auto placed = place(set);
  ASSERT_EQ(placed.size(), 6U);
  EXPECT_EQ(placed[4].parent_index, 1);
  EXPECT_EQ(placed[4].container, -1);
  EXPECT_EQ(placed[5].container, 4);
  EXPECT_NEAR(placed[5].side_m, 0.1, 1e-15);
  EXPECT_EQ(placed[5].grid_position, Eigen::Vector2d(2, 2));  // cell 7: row 1, column 1
}

TEST(Place, AChildMayFillAPartOfACell) {
  MarkerSet set = three_layers();
  // In black cell 6 (row 1, column 1), divided into 3 x 3 parts, the last but one: row 2, column 1.
  set.parents[0].marker.children = {{1, 6, code_with_black({5, 6, 7}), {}, 3, 7}};
  validate(set);
  const PlacedMarker child = place(set).at(1);
  const double cell = 1.6 / 7.0;
  EXPECT_NEAR(child.side_m, cell / 3.0, 1e-15);
  EXPECT_NEAR(child.origin_m.x(), (2.0 + 1.0 / 3.0) * cell, 1e-12);
  EXPECT_NEAR(child.origin_m.y(), (2.0 + 2.0 / 3.0) * cell, 1e-12);
  EXPECT_EQ(child.grid_position, Eigen::Vector2d(7, 8));
  EXPECT_EQ(child.parts, 3);

  // Beside it, one of a ninth: row 2, column 8.
  set.parents[0].marker.children.push_back({2, 6, code_with_black({1, 2, 5}), {}, 9, 26});
  EXPECT_NO_THROW(validate(set));
}

TEST(Place, RefusesCellsThatAreNotThere) {
  for (const int cell : {-1, 25}) {
    MarkerSet set = three_layers();
    set.parents[0].marker.children[0].cell = cell;
    EXPECT_THROW(place(set), std::invalid_argument) << cell;
  }
  for (const auto& [parts, part] : {std::pair{0, 0}, {1, 1}, {3, 9}, {3, -1}, {33, 0}}) {
    MarkerSet set = three_layers();
    set.parents[0].marker.children[0].parts = parts;
    set.parents[0].marker.children[0].part = part;
    EXPECT_THROW(place(set), std::invalid_argument) << parts << " " << part;
    EXPECT_THROW(validate(set), std::invalid_argument) << parts << " " << part;
  }
  MarkerSet set = three_layers();
  set.parents[0].marker.code = {};
  EXPECT_THROW(place(set), std::invalid_argument);
  set = three_layers();
  set.parents[0].side_m = std::nan("");
  EXPECT_THROW(place(set), std::invalid_argument);
}

// --- Rules --------------------------------------------------------------------------------------

TEST(Validate, AcceptsTheExample) { EXPECT_NO_THROW(validate(three_layers())); }

TEST(Validate, NamesTheMarkerAndTheRule) {
  struct Case {
    const char* message;
    std::function<void(MarkerSet&)> spoil;
  };
  const auto parent = [](MarkerSet& s) -> Marker& { return s.parents[0].marker; };
  const auto child = [](MarkerSet& s) -> Marker& { return s.parents[0].marker.children[0]; };
  const auto second = [](MarkerSet& s) -> Marker& { return s.parents[0].marker.children[1]; };
  const std::vector<Case> cases{
      {"needs a parent", [](auto& s) { s.parents.clear(); }},
      {"cells must be 3", [](auto& s) { s.cells = 9; }},
      {"cells must be 3", [](auto& s) { s.cells = 2; }},
      {"line width", [](auto& s) { s.line.inside = -0.01; }},
      {"line width", [](auto& s) { s.line.outside = 0.26; }},
      {"line width", [](auto& s) { s.line.outside = std::nan(""); }},
      {"need a line",
       [](auto& s) {
         s.line = {0.0, 0.0};
       }},
      {"parent 0: side_m", [](auto& s) { s.parents[0].side_m = 0.0; }},
      {"parent 0: side_m", [](auto& s) { s.parents[0].side_m = -1.6; }},
      {"parent 0: side_m", [](auto& s) { s.parents[0].side_m = std::nan(""); }},
      {"parent 0: side_m",
       [](auto& s) { s.parents[0].side_m = std::numeric_limits<double>::infinity(); }},
      {"parent 0: cells must be 3 … 8, not 0", [&](auto& s) { parent(s).code = {}; }},
      {"parent 0: cells must be 3 … 8, not 9", [&](auto& s) { parent(s).code.cells = 9; }},
      {"child 7: its code has more bits",
       [&](auto& s) { child(s).code.bits |= std::uint64_t{1} << 25; }},
      {"must not be negative", [&](auto& s) { child(s).id = -1; }},
      {"child 7: its code looks the same when turned",
       [&](auto& s) { child(s).code = code_with_black({}); }},
      {"child 3: this id is used twice", [&](auto& s) { child(s).children[0].id = second(s).id; }},
      {"parent 0: this id is used twice",
       [](auto& s) {
         s.parents.push_back(s.parents[0]);
         s.parents[1].marker.children.clear();
       }},
      {"child 3: its code is that of 7, perhaps turned",
       [&](auto& s) { second(s).code = rotated(child(s).code, 1); }},
      {"parent 1: its code is that of 0, perhaps turned",
       [&](auto& s) {
         s.parents.push_back({1.0, {1, -1, rotated(parent(s).code, 3), {}}});
       }},
      {"child 7 in parent 0: there is no cell 25", [&](auto& s) { child(s).cell = 25; }},
      {"child 7 in parent 0: there is no cell -1", [&](auto& s) { child(s).cell = -1; }},
      {"child 7 in parent 0: cell 1 is black", [&](auto& s) { child(s).cell = 1; }},
      {"child 9 in child 7: cell 5 is black", [&](auto& s) { child(s).children[0].cell = 5; }},
      {"child 3 in parent 0: cell 0 is taken", [&](auto& s) { second(s).cell = 0; }},
      {"child 7 in parent 0: part 4 of a cell of 2 x 2 is not there",
       [&](auto& s) {
         child(s).parts = 2;
         child(s).part = 4;
       }},
      {"child 3 in parent 0: part 0 of a cell of 2 x 2 is taken",
       [&](auto& s) {
         child(s).parts = second(s).parts = 2;
         second(s).cell = 0;
       }},
      {"child 3 in parent 0: part 4 of a cell of 3 x 3 is taken",
       [&](auto& s) {
         child(s).parts = 9;
         child(s).part = 9 * 3 + 5;  // the right-hand top corner of the middle third
         second(s).cell = 0;
         second(s).parts = 3;
         second(s).part = 4;
       }},
      {"child 7 in parent 0: cell 1 is black and has too much in it",
       [&](auto& s) {
         child(s).cell = second(s).cell = 1;
         child(s).parts = second(s).parts = 2;
         second(s).part = 1;
       }},
  };
  for (const Case& wrong : cases) {
    MarkerSet set = three_layers();
    wrong.spoil(set);
    try {
      validate(set);
      ADD_FAILURE() << "accepted: " << wrong.message;
    } catch (const std::invalid_argument& error) {
      EXPECT_NE(std::string(error.what()).find(wrong.message), std::string::npos) << error.what();
    }
  }
}

TEST(Validate, LetsAParentAndAChildShareIdAndCode) {
  // Their outer cells tell them apart, and they are counted separately.
  MarkerSet set = three_layers();
  set.parents[0].marker.children[0].id = 0;
  set.parents[0].marker.children[1].code = set.parents[0].marker.code;
  EXPECT_NO_THROW(validate(set));
}

TEST(Validate, LetsParentsWithoutChildrenDoWithoutALine) {
  MarkerSet set = three_layers();
  set.parents[0].marker.children.clear();
  set.line = {0.0, 0.0};
  EXPECT_NO_THROW(validate(set));
}

// --- markers.json -------------------------------------------------------------------------------

void expect_same(const Marker& a, const Marker& b) {
  EXPECT_EQ(a.id, b.id);
  EXPECT_EQ(a.cell, b.cell);
  EXPECT_EQ(a.parts, b.parts);
  EXPECT_EQ(a.part, b.part);
  EXPECT_EQ(a.code, b.code);
  ASSERT_EQ(a.children.size(), b.children.size());
  for (std::size_t i = 0; i < a.children.size(); ++i) expect_same(a.children[i], b.children[i]);
}

TEST(MarkersJson, RoundTrip) {
  MarkerSet set = three_layers();
  set.line = {0.012345678901234567, 1.0 / 14.0};
  set.parents.push_back(
      {0.1 + 0.2,
       {12, -1, code_with_black({1, 2, 6}, 6), {{4, 7, code_with_black({5, 6, 8}), {}, 4, 9}}}});
  const MarkerSet back = parse_markers(format_markers(set));
  EXPECT_EQ(back.cells, 5);
  EXPECT_EQ(back.line.inside, set.line.inside);
  EXPECT_EQ(back.line.outside, set.line.outside);
  ASSERT_EQ(back.parents.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(back.parents[i].side_m, set.parents[i].side_m);
    expect_same(back.parents[i].marker, set.parents[i].marker);
  }
  EXPECT_EQ(format_markers(back), format_markers(set));
}

TEST(MarkersJson, WritesWhatTheFormatPromises) {
  const Json json = Json::parse(format_markers(three_layers()));
  EXPECT_EQ(json["format"], "harco-markers");
  EXPECT_EQ(json["version"], 1);
  EXPECT_EQ(json["cells"], 5);
  EXPECT_EQ(json["layers"], 3);
  const Json& parent = json["parents"][0];
  EXPECT_EQ(parent["side_m"], 1.6);
  EXPECT_EQ(parent["position"], Json::parse("[0, 0]"));
  // Cells 1, 5 and 6 are black.
  EXPECT_EQ(parent["code"], "1011100111111111111111111");
  const Json& child = parent["children"][0];
  EXPECT_EQ(child["cell"], 0);
  EXPECT_EQ(child["id"], 7);
  EXPECT_EQ(child["position"], Json::parse("[7, 7]"));
  EXPECT_EQ(child["children"][0]["position"], Json::parse("[12, 12]"));
  EXPECT_EQ(parent["children"][1]["position"], Json::parse("[21, 21]"));
  EXPECT_EQ(parent["children"][1]["children"], Json::array());
}

TEST(MarkersJson, IgnoresWhatItDoesNotKnow) {
  Json json = Json::parse(format_markers(three_layers()));
  json["made_by"] = {{"name", "somebody"}};
  json["line"]["colour"] = "black";
  json["parents"][0]["note"] = Json::array({1, nullptr});
  json["parents"][0]["children"][0]["note"] = true;
  expect_same(parse_markers(json.dump()).parents[0].marker, three_layers().parents[0].marker);
}

TEST(MarkersJson, ChildrenMayBeLeftOut) {
  Json json = Json::parse(format_markers(three_layers()));
  json["parents"][0].erase("children");
  EXPECT_EQ(parse_markers(json.dump()).layers(), 1);
}

TEST(MarkersJson, RefusesWrongContentInOneLine) {
  struct Case {
    const char* message;
    std::function<void(Json&)> spoil;
  };
  const auto parent = [](Json& j) -> Json& { return j["parents"][0]; };
  const auto child = [](Json& j) -> Json& { return j["parents"][0]["children"][0]; };
  const std::vector<Case> cases{
      {"is not an object", [](Json& j) { j = Json::array(); }},
      {"is not an object", [](Json& j) { j = 7; }},
      {"'format' is missing", [](Json& j) { j.erase("format"); }},
      {"'format' is not", [](Json& j) { j["format"] = "aruco"; }},
      {"'version' is missing", [](Json& j) { j.erase("version"); }},
      {"version 2 is not supported", [](Json& j) { j["version"] = 2; }},
      {"version \"1\" is not supported", [](Json& j) { j["version"] = "1"; }},
      {"'cells' is missing", [](Json& j) { j.erase("cells"); }},
      {"'cells' is not a number", [](Json& j) { j["cells"] = "5"; }},
      {"'cells' is not a whole number", [](Json& j) { j["cells"] = 5.5; }},
      {"its code has 25 bits, not 6 x 6", [](Json& j) { j["cells"] = 6; }},
      {"'line' is missing", [](Json& j) { j.erase("line"); }},
      {"'line' is not an object", [](Json& j) { j["line"] = 0.07; }},
      {"'inside' is missing", [](Json& j) { j["line"].erase("inside"); }},
      {"'outside' is not a number", [](Json& j) { j["line"]["outside"] = nullptr; }},
      {"line width", [](Json& j) { j["line"]["outside"] = 0.5; }},
      {"'parents' is missing", [](Json& j) { j.erase("parents"); }},
      {"'parents' is not a list", [](Json& j) { j["parents"] = 1; }},
      {"needs a parent", [](Json& j) { j["parents"] = Json::array(); }},
      {"a parent is not an object", [](Json& j) { j["parents"][0] = "0"; }},
      {"'id' is missing", [&](Json& j) { parent(j).erase("id"); }},
      {"'id' is not a whole number", [&](Json& j) { parent(j)["id"] = 1e30; }},
      {"'id' is not a number", [&](Json& j) { child(j)["id"] = true; }},
      {"parent 0: 'side_m' is missing", [&](Json& j) { parent(j).erase("side_m"); }},
      {"parent 0: 'side_m' is not a number", [&](Json& j) { parent(j)["side_m"] = nullptr; }},
      {"parent 0: side_m must be", [&](Json& j) { parent(j)["side_m"] = 0; }},
      {"parent 0: 'code' is missing", [&](Json& j) { parent(j).erase("code"); }},
      {"parent 0: 'code' is not a string", [&](Json& j) { parent(j)["code"] = 1011; }},
      {"parent 0: ", [&](Json& j) { parent(j)["code"] = "101"; }},
      {"parent 0: ", [&](Json& j) { parent(j)["code"] = std::string(24, '1') + "\n"; }},
      {"parent 0: ", [&](Json& j) { parent(j)["code"] = std::string(100'000, '\n'); }},
      {"parent 0: 'children' is not a list", [&](Json& j) { parent(j)["children"] = 0; }},
      {"a child is not an object", [&](Json& j) { child(j) = nullptr; }},
      {"child 7: 'cell' is missing", [&](Json& j) { child(j).erase("cell"); }},
      {"child 7 in parent 0: cell 1 is black", [&](Json& j) { child(j)["cell"] = 1; }},
      {"child 7 in parent 0: there is no cell 30", [&](Json& j) { child(j)["cell"] = 30; }},
      {"more than 8 layers",
       [&](Json& j) {
         Json chain = child(j)["children"][0];
         for (int i = 0; i < 8; ++i) {
           Json above = chain;
           above["children"] = Json::array({chain});
           chain = above;
         }
         child(j)["children"][0] = chain;
       }},
  };
  for (const Case& wrong : cases) {
    Json json = Json::parse(format_markers(three_layers()));
    wrong.spoil(json);
    try {
      parse_markers(json.dump(), "some file");
      ADD_FAILURE() << "accepted: " << wrong.message;
    } catch (const Error& error) {
      const std::string what = error.what();
      EXPECT_EQ(what.rfind("some file: ", 0), 0U) << what;
      EXPECT_NE(what.find(wrong.message), std::string::npos) << what;
      EXPECT_EQ(what.find('\n'), std::string::npos) << what;
      EXPECT_LT(what.size(), 200U);
    }
  }
}

TEST(MarkersJson, RefusesEveryTruncation) {
  const std::string whole = format_markers(three_layers());
  const std::size_t end = whole.find_last_of('}');
  for (std::size_t length = 0; length <= end; ++length)
    EXPECT_THROW(parse_markers(whole.substr(0, length)), Error) << length;
}

TEST(MarkersJson, RefusesWhatIsNoJson) {
  for (const std::string& text :
       {std::string(), std::string("\xff\xfe\x00garbage", 10), std::string("{\"format\": NaN}"),
        std::string(200'000, '['), std::string("{\"version\": 1e999}")})
    EXPECT_THROW(parse_markers(text), Error) << text.substr(0, 20);
}

TEST(MarkersFile, SavesAndLoads) {
  const test::TemporaryFolder folder;
  save_markers(three_layers(), folder / "markers.json");
  expect_same(load_markers(folder / "markers.json").parents[0].marker,
              three_layers().parents[0].marker);
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 1);
}

TEST(MarkersFile, KeepsTheOldOneIfTheNewIsInvalid) {
  const test::TemporaryFolder folder;
  save_markers(three_layers(), folder / "markers.json");
  const std::string before = test::read_file(folder / "markers.json");
  EXPECT_THROW(save_markers(MarkerSet{}, folder / "markers.json"), std::invalid_argument);
  EXPECT_EQ(test::read_file(folder / "markers.json"), before);
}

TEST(MarkersFile, NamesWhatItCannotReadOrWrite) {
  const test::TemporaryFolder folder;
  const auto expect_named = [](const std::filesystem::path& file, const auto& action) {
    try {
      action(file);
      ADD_FAILURE() << file;
    } catch (const Error& error) {
      EXPECT_EQ(std::string(error.what()).rfind(file.string() + ": ", 0), 0U) << error.what();
    }
  };
  const auto load = [](const auto& file) { load_markers(file); };
  const auto save = [](const auto& file) { save_markers(three_layers(), file); };
  expect_named(folder / "none.json", load);
  expect_named(folder.path(), load);
  test::write_file(folder / "bad.json", "{");
  expect_named(folder / "bad.json", load);
  expect_named(folder / "no folder" / "markers.json", save);
  expect_named(folder.path(), save);
}

}  // namespace
}  // namespace harco
