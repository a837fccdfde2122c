// The kinds of connections behind a Link. Each is a file descriptor that never blocks.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

namespace harco::mavlink {

/// A file descriptor that is closed with its owner.
class Descriptor {
 public:
  explicit Descriptor(int fd = -1) : fd_(fd) {}
  ~Descriptor() { reset(); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  int get() const { return fd_; }
  bool open() const { return fd_ >= 0; }
  void reset(int fd = -1);

 private:
  int fd_;
};

/// What became of bytes.
enum class Outcome {
  done,     ///< some were taken or have come
  later,    ///< none now
  strange,  ///< they came from somebody else than the one spoken to
  broken    ///< the connection is gone
};

class Endpoint {
 public:
  virtual ~Endpoint() = default;

  /// Begins to connect; false if that failed at once. Does not wait.
  virtual bool open() = 0;
  /// Ends the connection, with all that wasn't sent yet.
  virtual void close() = 0;
  virtual int descriptor() const = 0;  ///< -1 while closed

  /// Connecting is over, and there is somebody to send to. May notice that it failed: then the
  /// endpoint is closed.
  virtual bool ready() = 0;

  /// `size` becomes the number of bytes that were taken.
  virtual Outcome write(const std::uint8_t* bytes, std::size_t& size) = 0;
  /// `size` is the room there is and becomes the number of bytes that came.
  virtual Outcome read(std::uint8_t* bytes, std::size_t& size) = 0;

  /// Bytes come in packets that are whole.
  virtual bool datagrams() const = 0;
  /// What was taken but isn't on its way yet, in bytes.
  virtual std::size_t backlog() const { return 0; }

  /// Of a listening endpoint: from now on, talk to whoever sent what was read last; or to nobody.
  virtual void adopt() {}
  virtual void forget() {}
};

/// As Link's constructor.
std::unique_ptr<Endpoint> make_endpoint(const std::string& description);

}  // namespace harco::mavlink
