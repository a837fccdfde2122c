// Sources that run on: newest frame first, ends, returns and stops.
#include "live_source.hpp"

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "frames.hpp"
#include "harco/error.hpp"
#include "shell.hpp"
#include "stream.hpp"

namespace harco::test {
namespace {

using cli::Frame;
using cli::LiveOptions;
using cli::LiveSource;
using cli::StopSignal;

/// A frame of 4 x 2 pixels, all of this grey.
std::string pgm(int grey, const std::string& comment = "") {
  return "P5\n" + comment + "4 2\n255\n" + std::string(8, static_cast<char>(grey));
}

/// Somebody who writes into a named pipe when he is told to.
class Writer {
 public:
  explicit Writer(const std::string& pipe) : fd_(open(pipe.c_str(), O_WRONLY)) {}
  ~Writer() { close(fd_); }
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;
  void write(const std::string& bytes) const {
    ASSERT_EQ(::write(fd_, bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
  }

 private:
  int fd_;
};

/// What a source tells people.
class Lines {
 public:
  std::function<void(const std::string&)> teller() {
    return [this](const std::string& line) {
      const std::lock_guard lock(mutex_);
      lines_.push_back(line);
    };
  }
  std::vector<std::string> all() const {
    const std::lock_guard lock(mutex_);
    return lines_;
  }

 private:
  mutable std::mutex mutex_;
  std::vector<std::string> lines_;
};

class LivePipe : public ::testing::Test {
 protected:
  LivePipe() { EXPECT_EQ(mkfifo(pipe_.c_str(), 0600), 0); }

  LiveOptions options() {
    LiveOptions options;
    options.tell = lines_.teller();
    return options;
  }

  TemporaryFolder folder_;
  std::string pipe_ = (folder_ / "pipe").string();
  std::string word_ = "pgm:" + pipe_;
  Lines lines_;
  StopSignal stop_;
};

TEST_F(LivePipe, GivesTheNewestFrameAndCountsWhatItDropped) {
  {
    LiveSource source(word_, options());
    const Writer writer(pipe_);
    Frame frame;
    frame.number = 77;
    writer.write(pgm(10, "# timestamp_s 1.5\n"));
    ASSERT_TRUE(source.wait(frame, stop_));
    EXPECT_EQ(frame.picture.grey.pixels, std::vector<std::uint8_t>(8, 10));
    EXPECT_EQ(frame.timestamp_s, 1.5);
    EXPECT_EQ(frame.dropped, 0U);
    EXPECT_EQ(frame.number, 77U);
    EXPECT_FALSE(source.take(frame));

    for (int grey = 11; grey <= 15; ++grey) writer.write(pgm(grey, "# timestamp_s 2\n"));
    while (source.dropped() < 4) std::this_thread::yield();
    ASSERT_TRUE(source.take(frame));
    EXPECT_EQ(frame.picture.grey.pixels[0], 15);
    EXPECT_EQ(frame.dropped, 4U);
    // The picture's memory goes round: nothing is left to take, all goes on.
    writer.write(pgm(16));
    ASSERT_TRUE(source.wait(frame, stop_));
    EXPECT_EQ(frame.picture.grey.pixels[0], 16);
    EXPECT_EQ(frame.dropped, 0U);
    EXPECT_EQ(frame.timestamp_s, frame.received_s);  // for want of a better one
  }
  ASSERT_FALSE(lines_.all().empty());
  EXPECT_EQ(lines_.all().back(), word_ + ": 4 of 7 frames were dropped, for want of time");
}

TEST_F(LivePipe, WaitsForWhoIsSlowIfTold) {
  LiveOptions all = options();
  all.drop = false;
  LiveSource source(word_, all);
  const Writer writer(pipe_);
  for (int grey = 1; grey <= 5; ++grey) writer.write(pgm(grey));
  Frame frame;
  for (int grey = 1; grey <= 5; ++grey) {
    ASSERT_TRUE(source.wait(frame, stop_));
    EXPECT_EQ(frame.picture.grey.pixels[0], grey);
  }
  EXPECT_EQ(source.dropped(), 0U);
}

TEST_F(LivePipe, ComesBackWhenItsWriterDoes) {
  LiveSource source(word_, options());
  Frame frame;
  for (int round = 0; round < 3; ++round) {
    {
      const Writer writer(pipe_);
      writer.write(pgm(20 + round));
      ASSERT_TRUE(source.wait(frame, stop_));
      EXPECT_EQ(frame.picture.grey.pixels[0], 20 + round);
      if (round == 1) writer.write("P5 4 2 255\nabc");  // breaks off in the middle of an image
    }
    while (lines_.all().size() < 2 * static_cast<std::size_t>(round) + 1) std::this_thread::yield();
  }
  const std::vector<std::string> lines = lines_.all();
  ASSERT_GE(lines.size(), 4U);
  EXPECT_EQ(lines[0], word_ + ": has ended; waiting for it to come back");
  EXPECT_NE(lines[1].find("is back after"), std::string::npos);
  EXPECT_NE(lines[2].find("in the middle of an image; waiting"), std::string::npos);
}

TEST_F(LivePipe, EndsWhereItIsNotToComeBack) {
  LiveOptions once = options();
  once.reopen = false;
  LiveSource source(word_, once);
  Frame frame;
  { Writer(pipe_).write(pgm(1) + "P6"); }
  EXPECT_TRUE(source.wait(frame, stop_));
  EXPECT_FALSE(source.wait(frame, stop_));
  EXPECT_TRUE(source.ended());
  EXPECT_NE(source.error().find("no binary PGM"), std::string::npos);
}

TEST_F(LivePipe, WaitingEndsAtOnceWhenStopped) {
  LiveSource source(word_, options());
  std::thread other([&] { stop_.raise(); });
  Frame frame;
  EXPECT_FALSE(source.wait(frame, stop_));  // nobody ever writes
  EXPECT_FALSE(source.ended());
  other.join();
}

TEST(LiveSource, AFileEndsByItself) {
  const TemporaryFolder folder;
  write_file(folder / "two.pgm", pgm(1) + pgm(2));
  LiveOptions all;
  all.drop = false;
  LiveSource source("pgm:" + (folder / "two.pgm").string(), all);
  const StopSignal stop;
  Frame frame;
  EXPECT_TRUE(source.wait(frame, stop));
  EXPECT_TRUE(source.wait(frame, stop));
  EXPECT_EQ(frame.picture.grey.pixels[0], 2);
  EXPECT_FALSE(source.wait(frame, stop));
  EXPECT_TRUE(source.ended());
  EXPECT_EQ(source.error(), "");
  EXPECT_THROW(LiveSource("pgm:/nowhere/at/all"), Error);
}

TEST(Pipelines, FollowFromWords) {
  EXPECT_EQ(cli::pipeline_of("gst:videotestsrc"), "videotestsrc ! videoconvert ! appsink");
  EXPECT_EQ(cli::pipeline_of("gst:a ! appsink name=x"), "a ! appsink name=x");
  EXPECT_NE(cli::pipeline_of("rtp://0.0.0.0:5600").find("port=5600"), std::string::npos);
  EXPECT_NE(cli::pipeline_of("rtp://0.0.0.0:5600").find("rtph264depay"), std::string::npos);
  EXPECT_NE(cli::pipeline_of("rtp://[::1]:9?encoding=jpeg").find("rtpjpegdepay"),
            std::string::npos);
  EXPECT_NE(cli::pipeline_of("rtsp://drone/live").find("location=\"rtsp://drone/live\""),
            std::string::npos);
  for (const char* word :
       {"rtp://host", "rtp://host:", "rtp://:5", "rtp://a b:5", "rtp://h:5x",
        "rtp://h:5?encoding=\"x\"", "rtp://h:5?codec=x", "rtsp://a\" ! b", "gst:"})
    EXPECT_THROW(cli::pipeline_of(word), Error) << word;
}

}  // namespace
}  // namespace harco::test
