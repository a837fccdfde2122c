// Streams by GStreamer; the module harco_gstreamer.so.
#include <algorithm>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <utility>

#include <gst/app/gstappsink.h>
#include <gst/gst.h>
#include <gst/video/video.h>

#include "harco/error.hpp"
#include "module.hpp"
#include "stream.hpp"

namespace harco::cli {
namespace {

// How long a pipeline may take to start, and how long a running one may stand still. Seconds.
constexpr double kStart = 10.0;
constexpr double kStill = 5.0;
// How often somebody who waits looks whether he shall stop.
constexpr GstClockTime kLook = 50 * GST_MSECOND;

// Formats whose first plane is the picture in grey.
constexpr const char* kGrey =
    "video/x-raw,format=(string){GRAY8,I420,YV12,NV12,NV21,Y42B,Y444,A420}";
constexpr const char* kColour = "video/x-raw,format=(string)BGR";

template <typename T, void (*kFree)(T*)>
struct Freed {
  void operator()(T* thing) const { kFree(thing); }
};
void unref(GstElement* element) { gst_object_unref(element); }
void unref_bus(GstBus* bus) { gst_object_unref(bus); }
void unref_sample(GstSample* sample) { gst_sample_unref(sample); }
void unref_message(GstMessage* message) { gst_message_unref(message); }
using Element = std::unique_ptr<GstElement, Freed<GstElement, unref>>;
using Bus = std::unique_ptr<GstBus, Freed<GstBus, unref_bus>>;
using Sample = std::unique_ptr<GstSample, Freed<GstSample, unref_sample>>;
using Message = std::unique_ptr<GstMessage, Freed<GstMessage, unref_message>>;

std::string one_line(std::string text) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

/// Takes the error away.
std::string text_of(GError* error) {
  const std::string text = error != nullptr ? one_line(error->message) : "unknown reason";
  g_clear_error(&error);
  return text;
}

/// Luma of a colour, by the weights of ITU-R BT.601, as elsewhere.
std::uint8_t luma(const std::uint8_t* bgr) {
  return static_cast<std::uint8_t>((29 * bgr[0] + 150 * bgr[1] + 77 * bgr[2] + 128) >> 8);
}

void copy_grey(const GstVideoFrame& frame, Image& grey) {
  for (int y = 0; y < grey.height; ++y)
    std::memcpy(grey.row(y),
                static_cast<const std::uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&frame, 0)) +
                    std::ptrdiff_t{y} * GST_VIDEO_FRAME_PLANE_STRIDE(&frame, 0),
                static_cast<std::size_t>(grey.width));
}

void copy_colour(const GstVideoFrame& frame, Picture& picture) {
  picture.colour.width = picture.grey.width;
  picture.colour.height = picture.grey.height;
  picture.colour.bgr.resize(3 * picture.grey.pixels.size());
  std::uint8_t* to = picture.colour.bgr.data();
  for (int y = 0; y < picture.grey.height; ++y)
    for (int x = 0; x < picture.grey.width; ++x, to += 3) {
      const auto* from = static_cast<const std::uint8_t*>(GST_VIDEO_FRAME_PLANE_DATA(&frame, 0)) +
                         std::ptrdiff_t{y} * GST_VIDEO_FRAME_PLANE_STRIDE(&frame, 0) + 3 * x;
      std::copy_n(from, 3, to);
      picture.grey.row(y)[x] = luma(from);
    }
}

class GstreamerStream : public Stream {
 public:
  GstreamerStream(std::string name, const std::string& description, bool colour,
                  const StopSignal& stop)
      : name_(std::move(name)), colour_(colour), stop_(stop) {
    GError* error = nullptr;
    pipeline_.reset(
        gst_parse_launch_full(description.c_str(), nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &error));
    if (!pipeline_ || error != nullptr)
      throw Error(name_ + ": is no pipeline (" + text_of(error) + ")");
    find_sink();
    bus_.reset(gst_element_get_bus(pipeline_.get()));
    start();
  }

  ~GstreamerStream() override { gst_element_set_state(pipeline_.get(), GST_STATE_NULL); }
  GstreamerStream(const GstreamerStream&) = delete;
  GstreamerStream& operator=(const GstreamerStream&) = delete;

  bool read(Picture& picture) override {
    const Sample sample = next_sample();
    if (!sample) return false;
    GstVideoInfo info;
    GstVideoFrame frame;
    GstBuffer* buffer = gst_sample_get_buffer(sample.get());
    if (!gst_video_info_from_caps(&info, gst_sample_get_caps(sample.get())) ||
        !gst_video_frame_map(&frame, &info, buffer, GST_MAP_READ))
      throw Error(name_ + ": gives no pictures");
    picture.grey.width = GST_VIDEO_FRAME_WIDTH(&frame);
    picture.grey.height = GST_VIDEO_FRAME_HEIGHT(&frame);
    picture.grey.pixels.resize(static_cast<std::size_t>(picture.grey.width) *
                               static_cast<std::size_t>(picture.grey.height));
    if (colour_)
      copy_colour(frame, picture);
    else
      copy_grey(frame, picture.grey);
    gst_video_frame_unmap(&frame);
    time_s_ = time_of(sample.get());
    any_ = true;
    return true;
  }

  double time_s() const override { return time_s_; }
  bool live() const override { return live_; }

 private:
  void find_sink() {
    GstIterator* sinks =
        gst_bin_iterate_all_by_element_factory_name(GST_BIN(pipeline_.get()), "appsink");
    GValue value = G_VALUE_INIT;
    if (gst_iterator_next(sinks, &value) == GST_ITERATOR_OK)
      sink_.reset(GST_ELEMENT(g_value_dup_object(&value)));
    g_value_unset(&value);
    gst_iterator_free(sinks);
    if (!sink_) throw Error(name_ + ": has no appsink");
    GstCaps* caps = gst_caps_from_string(colour_ ? kColour : kGrey);
    g_object_set(sink_.get(), "caps", caps, "sync", FALSE, "max-buffers", 1U, nullptr);
    gst_caps_unref(caps);
  }

  /// A pipeline that is live says so by having nothing to show before it plays.
  void start() {
    GstStateChangeReturn change = gst_element_set_state(pipeline_.get(), GST_STATE_PAUSED);
    for (double waited = 0.0; change == GST_STATE_CHANGE_ASYNC; waited += seconds(kLook)) {
      if (stop_.raised()) return;
      fail_on_error();
      if (waited > kStart) throw Error(name_ + ": doesn't start");
      change = gst_element_get_state(pipeline_.get(), nullptr, nullptr, kLook);
    }
    fail_on_error();
    if (change == GST_STATE_CHANGE_FAILURE) throw Error(name_ + ": can't be started");
    live_ = change == GST_STATE_CHANGE_NO_PREROLL;
    if (live_) g_object_set(sink_.get(), "drop", TRUE, nullptr);
    gst_element_set_state(pipeline_.get(), GST_STATE_PLAYING);
  }

  /// Null at the end, or when stopped.
  Sample next_sample() {
    GstAppSink* sink = GST_APP_SINK(sink_.get());
    for (double waited = 0.0; !stop_.raised(); waited += seconds(kLook)) {
      if (Sample sample{gst_app_sink_try_pull_sample(sink, kLook)}) return sample;
      fail_on_error();
      if (gst_app_sink_is_eos(sink)) return nullptr;
      if (any_ && waited > kStill) throw Error(name_ + ": has stood still for some seconds");
    }
    return nullptr;
  }

  void fail_on_error() const {
    const Message message{gst_bus_pop_filtered(bus_.get(), GST_MESSAGE_ERROR)};
    if (!message) return;
    GError* error = nullptr;
    gst_message_parse_error(message.get(), &error, nullptr);
    throw Error(name_ + ": " + text_of(error));
  }

  static double seconds(GstClockTime time) {
    return static_cast<double>(time) / static_cast<double>(GST_SECOND);
  }

  /// Of the buffer, on the clock that time_s promises.
  double time_of(GstSample* sample) const {
    const GstBuffer* buffer = gst_sample_get_buffer(sample);
    const GstClockTime stamp = GST_BUFFER_PTS(buffer);
    const GstClockTime running =
        gst_segment_to_running_time(gst_sample_get_segment(sample), GST_FORMAT_TIME, stamp);
    const bool known = GST_CLOCK_TIME_IS_VALID(stamp) && GST_CLOCK_TIME_IS_VALID(running);
    if (!live_) return known ? seconds(running) : time_s_;
    const double now = monotonic_s();
    GstClock* clock = gst_element_get_clock(pipeline_.get());
    if (!known || clock == nullptr) {
      if (clock != nullptr) gst_object_unref(clock);
      return now;
    }
    // How long ago, by whatever clock the pipeline runs on.
    const GstClockTime taken = gst_element_get_base_time(pipeline_.get()) + running;
    const double age = seconds(gst_clock_get_time(clock)) - seconds(taken);
    gst_object_unref(clock);
    return now - std::max(age, 0.0);
  }

  std::string name_;
  bool colour_;
  const StopSignal& stop_;
  Element pipeline_, sink_;
  Bus bus_;
  bool live_ = false;
  bool any_ = false;
  double time_s_ = 0.0;
};

void start_gstreamer() {
  GError* error = nullptr;
  if (gst_init_check(nullptr, nullptr, &error) == FALSE)
    throw Error("GStreamer can't be started (" + text_of(error) + ")");
}

}  // namespace

HARCO_MODULE_EXPORT void harco_gstreamer_open(const std::string& name, const std::string& pipeline,
                                              bool colour, const StopSignal& stop,
                                              std::unique_ptr<Stream>& stream) {
  start_gstreamer();
  stream = std::make_unique<GstreamerStream>(name, pipeline, colour, stop);
}

}  // namespace harco::cli
