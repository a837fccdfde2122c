// The mount verb as a user runs it.
#include <algorithm>
#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "command.hpp"
#include "harco/camera.hpp"
#include "harco/marker.hpp"
#include "lab/render.hpp"

namespace harco::test {
namespace {

namespace fs = std::filesystem;

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

/// A camera 0.3 m ahead of the vehicle's origin that looks straight down on a marker of 0.5 m, 2 m
/// below and 0.2 m to the right of it.
class MountVerb : public ::testing::Test {
 protected:
  MountVerb() {
    MarkerSet markers;
    markers.parents.push_back({0.5, {4, -1, parse_code("1010100010111000011010101"), {}}});
    save_markers(markers, folder_ / "markers.json");
    const Camera camera = Camera::pinhole(320, 240, 250.0);
    save_camera(camera, folder_ / "camera.yaml");
    write_file(folder_ / "mount.yaml", "looks: down\nimage_top: nose\noffset_m: [0.3, 0, 0]\n");
    lab::Scene scene;
    scene.camera = camera;
    // With the image's top to the nose, the image's right is the vehicle's.
    scene.parents.push_back({0, lab::look_at_marker({0.05, 0.25}, 2.0)});
    const Image image = lab::render(scene, markers, 1);
    std::string pgm = "P5 320 240 255\n";
    pgm.append(image.pixels.begin(), image.pixels.end());
    write_file(folder_ / "a.pgm", pgm);
  }

  std::string path(const std::string& name) const {
    std::string quoted = "'";
    quoted += (folder_ / name).string();
    quoted += "'";
    return quoted;
  }

  void expect_refused(const std::string& arguments, const std::string& what) const {
    const CommandResult result = run_harco("mount " + arguments);
    EXPECT_EQ(result.status, 2) << arguments;
    EXPECT_EQ(result.output, "") << arguments;
    EXPECT_EQ(std::count(result.errors.begin(), result.errors.end(), '\n'), 1) << result.errors;
    EXPECT_TRUE(contains(result.errors, what)) << arguments << ": " << result.errors;
  }

  TemporaryFolder folder_;
};

TEST_F(MountVerb, SaysWhatTheFileMeans) {
  const CommandResult result = run_harco("mount --mount " + path("mount.yaml"));
  EXPECT_EQ(result.status, 0) << result.errors;
  EXPECT_TRUE(contains(result.output, "image top is the vehicle's:    nose\n")) << result.output;
  EXPECT_TRUE(contains(result.output, "0.30 m ahead\n")) << result.output;
}

TEST_F(MountVerb, DrawsAndSaysWhereMarkersAre) {
  const CommandResult result = run_harco(
      "mount --mount " + path("mount.yaml") + " --camera " + path("camera.yaml") + " --markers " +
      path("markers.json") + " --annotate " + path("seen.png") + " " + path("a.pgm"));
  ASSERT_EQ(result.status, 0) << result.errors;
  EXPECT_TRUE(contains(result.output,
                       "parent 4 is 2.00 m below, 0.30 m ahead and 0.20 m to the right of the "
                       "vehicle"))
      << result.output;
  EXPECT_GT(fs::file_size(folder_ / "seen.png"), 1000U);
}

TEST_F(MountVerb, RefusesWhatMakesNoSense) {
  const std::string mount = "--mount " + path("mount.yaml");
  write_file(folder_ / "wrong.yaml", "looks: sideways\n");
  expect_refused("", "--mount");
  expect_refused("--mount " + path("none.yaml"), "none.yaml");
  expect_refused("--mount " + path("wrong.yaml"), "wrong.yaml");
  expect_refused(mount + " " + path("a.pgm"), "needs --camera");
  expect_refused(mount + " --camera " + path("camera.yaml") + " " + path("a.pgm"), "--annotate");
  expect_refused(mount + " --annotate " + path("seen.png"), "need a SOURCE");
  expect_refused(mount + " --camera " + path("camera.yaml") + " --annotate " + path("seen.png") +
                     " " + path("missing.pgm"),
                 "missing.pgm");
  save_camera(Camera::pinhole(640, 480, 500.0), folder_ / "other.yaml");
  expect_refused(mount + " --camera " + path("other.yaml") + " --annotate " + path("seen.png") +
                     " " + path("a.pgm"),
                 "is 320 x 240 pixels, but the camera has 640 x 480");
  EXPECT_FALSE(fs::exists(folder_ / "seen.png"));
}

TEST(Command, NamesAVerbThatItDoesntHave) {
  const CommandResult result = run_harco("detekt --markers x");
  EXPECT_EQ(result.status, 2);
  EXPECT_EQ(result.errors,
            "harco: there is no verb or option 'detekt' (harco --help lists them)\n");
  EXPECT_TRUE(contains(run_harco("").errors, "required"));
}

}  // namespace
}  // namespace harco::test
