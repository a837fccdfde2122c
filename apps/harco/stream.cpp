#include "stream.hpp"

#include <algorithm>
#include <cctype>

#include <fmt/format.h>

#include "harco/error.hpp"
#include "module.hpp"

namespace harco::cli {
namespace {

constexpr const char* kSink = " ! videoconvert ! appsink";

/// What is left of `text` behind `prefix`; empty if it begins otherwise.
std::string behind(const std::string& prefix, const std::string& text) {
  return text.rfind(prefix, 0) == 0 ? text.substr(prefix.size()) : std::string();
}

/// HOST:PORT[?encoding=NAME]. The sender's RTP payload type doesn't matter.
std::string rtp_pipeline(const std::string& word, const std::string& address) {
  const std::size_t query = address.find('?');
  const std::string place = address.substr(0, query);
  std::string encoding = "H264";
  if (query != std::string::npos) encoding = behind("encoding=", address.substr(query + 1));
  std::transform(encoding.begin(), encoding.end(), encoding.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  const std::size_t colon = place.rfind(':');
  const std::string host = place.substr(0, colon);
  const std::string port = colon == std::string::npos ? "" : place.substr(colon + 1);
  const auto plain = [](const std::string& text, const char* more) {
    return !text.empty() && std::all_of(text.begin(), text.end(), [&](unsigned char c) {
      return std::isalnum(c) != 0 ||
             std::string(more).find(static_cast<char>(c)) != std::string::npos;
    });
  };
  if (!plain(host, ".:-[]") || !plain(encoding, "-") || port.size() > 5 || port.empty() ||
      !std::all_of(port.begin(), port.end(), [](char c) { return c >= '0' && c <= '9'; }))
    throw Error(word + ": is not rtp://HOST:PORT or rtp://HOST:PORT?encoding=NAME");
  std::string depay = encoding;
  std::transform(depay.begin(), depay.end(), depay.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return fmt::format(
      "udpsrc address={} port={} caps=\"application/x-rtp,media=video,clock-rate=90000,"
      "encoding-name={}\" ! rtp{}depay ! decodebin{}",
      host, port, encoding, depay, kSink);
}

}  // namespace

std::string pipeline_of(const std::string& word) {
  if (const std::string pipeline = behind("gst:", word); !pipeline.empty())
    return pipeline.find("appsink") == std::string::npos ? pipeline + kSink : pipeline;
  if (const std::string address = behind("rtp://", word); !address.empty())
    return rtp_pipeline(word, address);
  const bool rtsp = !behind("rtsp://", word).empty() || !behind("rtsps://", word).empty();
  if (!rtsp || word.find('"') != std::string::npos)
    throw Error(word + ": is not rtsp://…, rtp://HOST:PORT or gst:PIPELINE");
  return fmt::format(
      "rtspsrc location=\"{}\" latency=0 ! application/x-rtp,media=video ! decodebin{}", word,
      kSink);
}

std::unique_ptr<Stream> open_stream(const std::string& word, bool colour, const StopSignal& stop) {
  using Open = void(const std::string&, const std::string&, bool, const StopSignal&,
                    std::unique_ptr<Stream>&);
  auto* const open =
      reinterpret_cast<Open*>(module_symbol("harco_gstreamer.so", "harco_gstreamer_open"));
  std::unique_ptr<Stream> stream;
  open(word, pipeline_of(word), colour, stop, stream);
  return stream;
}

}  // namespace harco::cli
