#include "harco/link.hpp"

#include <algorithm>
#include <array>

#include <poll.h>

#include "endpoint.hpp"

namespace harco::mavlink {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

std::uint64_t unix_time_us() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return static_cast<std::uint64_t>(
      std::chrono::duration_cast<std::chrono::microseconds>(now).count());
}

/// As much is read in one go, so that a flood leaves time for the rest.
constexpr int kMostReads = 64;

}  // namespace

class Link::Impl {
 public:
  Impl(std::string description, const LinkOptions& options)
      : description_(std::move(description)),
        options_(options),
        endpoint_(make_endpoint(description_)),
        packer_(options_.from) {
    if (options_.key) packer_.sign_with(*options_.key);
    if (options_.key) parser_.require_signature(*options_.key);
    if (endpoint_->descriptor() < 0) endpoint_->open();
    opened_ = Clock::now();
  }

  bool send(const Message& message) {
    const Packet packet = packer_.pack(message, unix_time_us());
    const bool taken = ready() && flush() && !stalled() && begin(packet);
    ++(taken ? counts_.sent : counts_.dropped);
    return taken;
  }

  void wait(milliseconds most, int wake, std::vector<Received>& out) {
    reopen_if_due();
    forget_if_silent();
    if (ready()) flush();
    const bool connecting = endpoint_->descriptor() >= 0 && !endpoint_->datagrams() && !ready();
    const bool writing = connecting || !unsent_.empty();
    std::array<pollfd, 2> files{};
    files[0].fd = endpoint_->descriptor();
    files[0].events = static_cast<short>(POLLIN | (writing ? POLLOUT : 0));
    files[1].fd = wake;
    files[1].events = POLLIN;
    const bool busy = endpoint_->descriptor() < 0 || writing;
    const milliseconds timeout = busy ? std::min(most, options_.retry) : most;
    poll(files.data(), files.size(), static_cast<int>(timeout.count()));
    if (files[0].revents != 0) read(out);
    if (ready() && stalled()) break_off();
  }

  bool connected() { return ready(); }
  const std::string& description() const { return description_; }
  void set_from(Address from) { packer_.set_from(from); }

  LinkCounts counts() const {
    LinkCounts all = counts_;
    all.received = parser_.counts();
    return all;
  }

 private:
  bool ready() {
    const bool now = endpoint_->ready();
    if (now && !was_ready_) ++counts_.openings;
    was_ready_ = now;
    return now;
  }

  void reopen_if_due() {
    if (endpoint_->descriptor() >= 0 || Clock::now() - opened_ < options_.retry) return;
    opened_ = Clock::now();
    endpoint_->open();
  }

  void forget_if_silent() {
    if (endpoint_->datagrams() && ready() && Clock::now() - heard_ > options_.forget)
      endpoint_->forget();
  }

  void break_off() {
    std::vector<Received> rest;
    parser_.finish(rest);
    endpoint_->close();
    unsent_.clear();
    arrived_since_.reset();
    begun_ = 0;
    was_ready_ = false;
    opened_ = Clock::now();
  }

  /// Sends the rest of a frame of which a part has gone already. True if none is left.
  bool flush() {
    if (unsent_.empty()) return true;
    std::size_t size = unsent_.size();
    const Outcome outcome = endpoint_->write(unsent_.data(), size);
    if (outcome == Outcome::broken) break_off();
    if (outcome == Outcome::done)
      unsent_.erase(unsent_.begin(), unsent_.begin() + static_cast<std::ptrdiff_t>(size));
    return outcome != Outcome::broken && unsent_.empty();
  }

  bool begin(const Packet& packet) {
    std::size_t size = packet.size;
    switch (endpoint_->write(packet.bytes.data(), size)) {
      case Outcome::done:
        begun_ += packet.size;
        if (!endpoint_->datagrams())
          unsent_.assign(packet.bytes.begin() + static_cast<std::ptrdiff_t>(size),
                         packet.bytes.begin() + static_cast<std::ptrdiff_t>(packet.size));
        return true;
      case Outcome::broken:
        break_off();
        return false;
      default:
        return false;
    }
  }

  /// Whether the other end has taken nothing for too long, though there was something.
  bool stalled() {
    const std::uint64_t backlog = endpoint_->backlog() + unsent_.size();
    const std::uint64_t arrived = begun_ - std::min(begun_, backlog);
    const auto now = Clock::now();
    if (backlog == 0 || !arrived_since_ || arrived != arrived_) arrived_since_ = now;
    arrived_ = arrived;
    return now - *arrived_since_ > options_.stall;
  }

  void read(std::vector<Received>& out) {
    std::array<std::uint8_t, 2048> bytes{};
    for (int i = 0; i < kMostReads && endpoint_->descriptor() >= 0; ++i) {
      if (!endpoint_->datagrams() && !ready()) return;
      std::size_t size = bytes.size();
      switch (endpoint_->read(bytes.data(), size)) {
        case Outcome::later:
          return;
        case Outcome::broken:
          break_off();
          return;
        case Outcome::strange:
          listen_to_stranger(bytes.data(), size, out);
          break;
        case Outcome::done:
          hear(bytes.data(), size, out);
          break;
      }
    }
  }

  void hear(const std::uint8_t* bytes, std::size_t size, std::vector<Received>& out) {
    const std::size_t before = out.size();
    parser_.feed(bytes, size, out);
    if (endpoint_->datagrams()) parser_.finish(out);
    if (out.size() > before) heard_ = Clock::now();
  }

  /// Somebody else's datagram: whoever speaks MAVLink first is the one to talk to.
  void listen_to_stranger(const std::uint8_t* bytes, std::size_t size, std::vector<Received>& out) {
    ++counts_.strangers;
    if (ready()) return;
    const std::size_t before = out.size();
    hear(bytes, size, out);
    if (out.size() > before) endpoint_->adopt();
  }

  std::string description_;
  LinkOptions options_;
  std::unique_ptr<Endpoint> endpoint_;
  Packer packer_;
  Parser parser_;
  LinkCounts counts_;
  std::vector<std::uint8_t> unsent_;  ///< the rest of a frame that was begun
  Clock::time_point opened_;          ///< when it was tried last
  Clock::time_point heard_;           ///< last message
  std::uint64_t begun_ = 0;           ///< bytes of all frames begun on this connection ...
  std::uint64_t arrived_ = 0;         ///< ... and how many of them the other end has
  std::optional<Clock::time_point> arrived_since_;  ///< since when these are as many
  bool was_ready_ = false;
};

Link::Link(const std::string& description, const LinkOptions& options)
    : impl_(std::make_unique<Impl>(description, options)) {}
Link::~Link() = default;
Link::Link(Link&&) noexcept = default;
Link& Link::operator=(Link&&) noexcept = default;

bool Link::send(const Message& message) { return impl_->send(message); }
void Link::wait(std::chrono::milliseconds most, int wake, std::vector<Received>& out) {
  impl_->wait(most, wake, out);
}
bool Link::connected() const { return impl_->connected(); }
const std::string& Link::description() const { return impl_->description(); }
void Link::set_from(Address from) { impl_->set_from(from); }
LinkCounts Link::counts() const { return impl_->counts(); }

}  // namespace harco::mavlink
