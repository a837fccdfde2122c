// How long detectors take for the same frames: ours, OpenCV's ArUco, AprilTag 3, and a plain pass
// over the pixels as the physical limit. One process, one thread, pinned to one core; every frame
// goes through all detectors before the next one. Times are the thread's CPU time. Prints a table
// with what was found beside the time.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <sched.h>

#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>
#include <CLI/CLI.hpp>
#include <opencv2/aruco.hpp>
#include <opencv2/core.hpp>

#include "frames.hpp"
#include "harco/harco.hpp"
#include "lab/thread_time.hpp"

namespace {

using namespace harco;
using bench::Content;
using bench::Frame;

struct Reading {
  int id;
  Eigen::Vector2d centre;
};
using Readings = std::vector<Reading>;

struct System {
  std::string name;
  int times;  ///< in each turn, 1 … kOften: what is quick is timed more often
  std::function<void(const Image&)> detect;
  std::function<Readings()> readings;  ///< of the last frame, outside of the time measured
};

constexpr int kOften = 5;

void pin_to_this_core() {
  cpu_set_t cores;
  CPU_ZERO(&cores);
  CPU_SET(static_cast<std::size_t>(sched_getcpu()), &cores);
  sched_setaffinity(0, sizeof cores, &cores);
}

/// Threshold against a constant, every pixel read and written once; compilers vectorise it.
System streaming_pass() {
  auto out = std::make_shared<std::vector<std::uint8_t>>();
  return {"streaming pass", kOften,
          [out](const Image& image) {
            const std::size_t count = image.pixels.size();
            out->resize(count);
            const std::uint8_t* __restrict from = image.pixels.data();
            std::uint8_t* __restrict to = out->data();
            for (std::size_t i = 0; i < count; ++i) to[i] = from[i] < 100 ? 0 : 255;
          },
          [] { return Readings(); }};
}

System ours(const MarkerSet& markers, double min_side_px) {
  DetectorOptions options;
  options.min_side_px = min_side_px;
  auto detector = std::make_shared<Detector>(markers, options);
  auto found = std::make_shared<std::vector<Detection>>();
  return {"HArCo", kOften, [=](const Image& image) { *found = detector->detect(image.view()); },
          [found] {
            Readings readings;
            for (const Detection& d : *found)
              readings.push_back(
                  {d.id, 0.25 * (d.corners[0] + d.corners[1] + d.corners[2] + d.corners[3])});
            return readings;
          }};
}

System opencv(const std::string& name, int refinement, bool aruco3) {
  struct State {
    std::vector<std::vector<cv::Point2f>> corners;
    std::vector<int> ids;
  };
  auto state = std::make_shared<State>();
  auto parameters = cv::aruco::DetectorParameters::create();
  parameters->cornerRefinementMethod = refinement;
  parameters->useAruco3Detection = aruco3;
  auto dictionary = cv::aruco::getPredefinedDictionary(cv::aruco::DICT_APRILTAG_36h11);
  return {
      name, 1,
      [=](const Image& image) {
        const cv::Mat grey(image.height, image.width, CV_8U,
                           const_cast<std::uint8_t*>(image.pixels.data()));
        state->corners.clear();
        state->ids.clear();
        cv::aruco::detectMarkers(grey, dictionary, state->corners, state->ids, parameters);
      },
      [state] {
        Readings readings;
        for (std::size_t i = 0; i < state->ids.size(); ++i) {
          cv::Point2f sum(0, 0);
          for (const cv::Point2f& corner : state->corners[i]) sum += corner;
          readings.push_back({state->ids[i], 0.25 * Eigen::Vector2f(sum.x, sum.y).cast<double>()});
        }
        return readings;
      }};
}

System apriltag(float decimate) {
  struct State {
    apriltag_family_t* family = tag36h11_create();
    apriltag_detector_t* detector = apriltag_detector_create();
    zarray_t* found = nullptr;
    State() = default;
    State(const State&) = delete;
    State& operator=(const State&) = delete;
    void forget() {
      if (found) apriltag_detections_destroy(found);
      found = nullptr;
    }
    ~State() {
      forget();
      apriltag_detector_destroy(detector);
      tag36h11_destroy(family);
    }
  };
  auto state = std::make_shared<State>();
  apriltag_detector_add_family(state->detector, state->family);
  state->detector->quad_decimate = decimate;
  state->detector->nthreads = 1;
  return {decimate > 1.0F ? "AprilTag 3, decimate 2" : "AprilTag 3, decimate 1", 1,
          [state](const Image& image) {
            state->forget();
            image_u8_t picture{image.width, image.height, image.width,
                               const_cast<std::uint8_t*>(image.pixels.data())};
            state->found = apriltag_detector_detect(state->detector, &picture);
          },
          [state] {
            Readings readings;
            for (int i = 0; i < zarray_size(state->found); ++i) {
              apriltag_detection_t* tag = nullptr;
              zarray_get(state->found, i, static_cast<void*>(&tag));
              readings.push_back({tag->id, {tag->c[0] - 0.5, tag->c[1] - 0.5}});
            }
            return readings;
          }};
}

struct Tally {
  std::vector<double> ms;
  int markers = 0;
  int found = 0;
  int wrong = 0;
};

void judge(const Frame& frame, const Readings& readings, Tally& tally) {
  tally.markers += static_cast<int>(frame.markers.size());
  std::vector<bool> taken(frame.markers.size());
  for (const Reading& reading : readings) {
    bool right = false;
    for (std::size_t i = 0; i < frame.markers.size() && !right; ++i) {
      const auto& c = frame.markers[i].corners;
      const Eigen::Vector2d centre = 0.25 * (c[0] + c[1] + c[2] + c[3]);
      right = frame.markers[i].id == reading.id &&
              (reading.centre - centre).norm() < 0.15 * (c[2] - c[0]).norm();
      if (right && !taken[i]) {
        taken[i] = true;
        ++tally.found;
      }
    }
    if (!right) ++tally.wrong;
  }
}

double quantile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  const auto index = static_cast<std::size_t>(share * static_cast<double>(values.size() - 1) + 0.5);
  return values[index];
}

/// Frames of one kind and size.
struct Kind {
  bench::Size size;
  std::string name;
  int markers;  ///< in each frame
  std::function<Frame(std::uint64_t seed)> make;
};

std::vector<Kind> kinds_of(const MarkerSet& markers, const std::vector<bench::Size>& sizes,
                           const std::vector<std::string>& contents) {
  const auto wanted = [&](const char* name) {
    return contents.empty() || std::find(contents.begin(), contents.end(), name) != contents.end();
  };
  std::vector<Kind> kinds;
  for (const bench::Size size : sizes)
    for (const Content content : bench::kContents) {
      if (!wanted(bench::to_string(content))) continue;
      const bool single = content == Content::one || content == Content::night;
      kinds.push_back({size, bench::to_string(content),
                       single                       ? 1
                       : content == Content::thirty ? 30
                                                    : 0,
                       [&markers, size, content](std::uint64_t seed) {
                         return bench::make_frame(markers, size, content, seed);
                       }});
    }
  return kinds;
}

std::vector<Kind> grids_of(const MarkerSet& markers, const bench::Size& size,
                           const std::vector<int>& counts) {
  std::vector<Kind> kinds;
  for (const int count : counts)
    kinds.push_back({size, "grid", count, [&markers, size, count](std::uint64_t seed) {
                       return bench::make_grid(markers, size, count, seed);
                     }});
  return kinds;
}

std::vector<Tally> measure(const std::vector<System>& systems, const Kind& kind, int frames,
                           int repeats) {
  std::vector<Tally> tallies(systems.size());
  for (int i = 0; i < frames; ++i) {
    const Frame frame = kind.make(static_cast<std::uint64_t>(i + 1));
    // The first frame's first turn lets memory grow.
    for (int repeat = i == 0 ? -1 : 0; repeat < repeats; ++repeat)
      for (int time = 0; time < kOften; ++time)
        for (std::size_t s = 0; s < systems.size(); ++s) {
          if (time >= systems[s].times) continue;
          const double start = lab::thread_ms();
          systems[s].detect(frame.image);
          const double spent = lab::thread_ms() - start;
          if (repeat >= 0) tallies[s].ms.push_back(spent);
          if (repeat == 0 && time == 0) judge(frame, systems[s].readings(), tallies[s]);
        }
  }
  return tallies;
}

void print(const Kind& kind, const std::vector<System>& systems, const std::vector<Tally>& tallies,
           std::FILE* table) {
  std::printf("\n%d x %d, %s, %d markers\n%-24s %9s %9s %10s %8s %8s %6s\n", kind.size.width,
              kind.size.height, kind.name.c_str(), kind.markers, "", "median ms", "p99 ms",
              "x the pass", "x ours", "recall", "false");
  const double pass = quantile(tallies[0].ms, 0.5);
  const double own = quantile(tallies[1].ms, 0.5);
  for (std::size_t s = 0; s < systems.size(); ++s) {
    const Tally& tally = tallies[s];
    const double median = quantile(tally.ms, 0.5);
    const double p99 = quantile(tally.ms, 0.99);
    const double recall = tally.markers > 0 ? 100.0 * tally.found / tally.markers : std::nan("");
    std::printf("%-24s %9.3f %9.3f %10.1f %8.2f %7.1f%% %6d\n", systems[s].name.c_str(), median,
                p99, median / pass, median / own, recall, tally.wrong);
    if (table)
      std::fprintf(table, "%d,%d,%s,%d,\"%s\",%.4f,%.4f,%.2f,%d\n", kind.size.width,
                   kind.size.height, kind.name.c_str(), kind.markers, systems[s].name.c_str(),
                   median, p99, recall, tally.wrong);
  }
  std::fflush(stdout);
}

/// Throws CLI::ValidationError.
bench::Size size_of(const std::string& text) {
  bench::Size size{};
  if (std::sscanf(text.c_str(), "%dx%d", &size.width, &size.height) != 2)
    throw CLI::ValidationError(text + " is not WIDTHxHEIGHT");
  return size;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Times detectors on the same frames"};
  std::vector<std::string> sizes{"750x480", "1280x720", "1920x1080", "3840x2160"};
  std::vector<std::string> contents;
  std::vector<int> counts;
  int frames = 8;
  int repeats = 3;
  double min_side = DetectorOptions().min_side_px;
  bool only_ours = false;
  std::string csv;
  app.add_option("--sizes", sizes, "WIDTHxHEIGHT ...")->capture_default_str();
  app.add_option("--contents", contents,
                 "one thirty texture night noise checkerboard text; default: all");
  app.add_option("--counts", counts,
                 "numbers of markers, 0 ... 30: frames of 1920x1080 with so many as well")
      ->check(CLI::Range(0, 30));
  app.add_option("--frames", frames, "of each kind")->capture_default_str();
  app.add_option("--repeats", repeats, "of each frame, and five times as many of what is quick")
      ->capture_default_str();
  app.add_option("--min-side", min_side, "of the markers that ours looks for, px")
      ->check(CLI::Range(4.0, 1000.0))
      ->capture_default_str();
  app.add_flag("--only-ours", only_ours, "ours and the streaming pass, none of the rivals");
  app.add_option("--csv", csv, "writes the table to this file as well");
  std::vector<bench::Size> frame_sizes;
  try {
    app.parse(argc, argv);
    for (const std::string& text : sizes) frame_sizes.push_back(size_of(text));
  } catch (const CLI::ParseError& error) {
    return app.exit(error);
  }

  pin_to_this_core();
  cv::setNumThreads(1);
  std::FILE* table = nullptr;
  if (!csv.empty()) {
    table = std::fopen(csv.c_str(), "w");
    if (!table) {
      std::fprintf(stderr, "compare: %s can't be written\n", csv.c_str());
      return 2;
    }
    std::fprintf(table,
                 "width,height,content,markers,system,median_ms,p99_ms,recall,false_positives\n");
  }

  const MarkerSet markers = bench::apriltag_set();
  std::vector<System> systems;
  systems.push_back(streaming_pass());
  systems.push_back(ours(markers, min_side));
  if (!only_ours) {
    systems.push_back(opencv("OpenCV ArUco", cv::aruco::CORNER_REFINE_NONE, false));
    systems.push_back(opencv("OpenCV ArUco, sub-pixel", cv::aruco::CORNER_REFINE_SUBPIX, false));
    systems.push_back(opencv("OpenCV ArUco 3", cv::aruco::CORNER_REFINE_NONE, true));
    systems.push_back(apriltag(1.0F));
    systems.push_back(apriltag(2.0F));
  }
  std::vector<Kind> kinds = kinds_of(markers, frame_sizes, contents);
  for (Kind& grid : grids_of(markers, {1920, 1080}, counts)) kinds.push_back(std::move(grid));
  for (const Kind& kind : kinds)
    print(kind, systems, measure(systems, kind, frames, repeats), table);
  if (table) std::fclose(table);
  return 0;
}
