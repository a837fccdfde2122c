// A connection to an autopilot that neither hangs nor hoards: UDP, TCP or a serial line.
// Library harco::autopilot.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "harco/mavlink.hpp"

namespace harco::mavlink {

struct LinkOptions {
  std::optional<SigningKey> key;  ///< frames are signed, and only signed ones are heard
  Address from;                   ///< who we are

  /// A broken connection is opened anew this often.
  std::chrono::milliseconds retry{500};
  /// What the other end hasn't taken for so long is thrown away, and the connection opened anew: it
  /// would arrive late, as news.
  std::chrono::milliseconds stall{500};
  /// A UDP link without an address of its own answers whoever spoke first, until that one has been
  /// silent for so long.
  std::chrono::milliseconds forget{5000};
};

/// What a link has done.
struct LinkCounts {
  ParserCounts received;
  std::uint64_t sent = 0;       ///< frames handed over
  std::uint64_t dropped = 0;    ///< frames that couldn't be, and are gone
  std::uint64_t openings = 0;   ///< how often the connection was made
  std::uint64_t strangers = 0;  ///< datagrams from others than the one spoken to
};

/// One end of a connection. No call but `wait` takes time. Use it from one thread.
class Link {
 public:
  /// Descriptions:
  ///   udpin:HOST:PORT      listens, and answers whoever sends first
  ///   udpout:HOST:PORT     sends there
  ///   tcp:HOST:PORT        connects to a server there
  ///   serial:DEVICE:BAUD   8 bits, no parity, no flow control
  /// What isn't there yet (a server, a vehicle) is waited for; a port that is taken, a host without
  /// address, a device that can't be opened throw Error. Anything else throws Error as well: the
  /// description is wrong.
  explicit Link(const std::string& description, const LinkOptions& options = {});
  ~Link();
  Link(Link&&) noexcept;
  Link& operator=(Link&&) noexcept;

  /// Sends, if that can be done at once; otherwise the message is gone, and false is returned.
  bool send(const Message& message);

  /// Waits until something comes, `wake` (a file descriptor; -1 for none) can be read, or
  /// `most` is over, and appends the messages that came to `out`.
  void wait(std::chrono::milliseconds most, int wake, std::vector<Received>& out);

  /// There is somebody to send to.
  bool connected() const;
  const std::string& description() const;
  void set_from(Address from);
  LinkCounts counts() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace harco::mavlink
