#include "endpoint.hpp"

#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <optional>

#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <linux/sockios.h>

#include "harco/error.hpp"

namespace harco::mavlink {
namespace {

bool would_block(int error) { return error == EAGAIN || error == EWOULDBLOCK || error == EINTR; }

std::string system_message(int error) { return std::strerror(error); }

/// An address of IPv4 or IPv6.
struct SocketAddress {
  sockaddr_storage storage{};
  socklen_t size = sizeof(sockaddr_storage);

  const sockaddr* get() const { return reinterpret_cast<const sockaddr*>(&storage); }
  sockaddr* get() { return reinterpret_cast<sockaddr*>(&storage); }
  bool operator==(const SocketAddress& other) const {
    return size == other.size && std::memcmp(&storage, &other.storage, size) == 0;
  }
};

SocketAddress resolve(const std::string& description, const std::string& host,
                      const std::string& port, bool passive) {
  addrinfo hints{};
  hints.ai_family = AF_UNSPEC;
  hints.ai_socktype = SOCK_DGRAM;  // any type will do: it makes each address appear once
  hints.ai_flags = AI_NUMERICSERV | (passive ? AI_PASSIVE : 0);
  addrinfo* list = nullptr;
  const int failed =
      getaddrinfo(host.empty() ? nullptr : host.c_str(), port.c_str(), &hints, &list);
  if (failed != 0 || list == nullptr)
    throw Error(description + ": " + host + " has no address (" + gai_strerror(failed) + ")");
  SocketAddress address;
  address.size = list->ai_addrlen;
  std::memcpy(&address.storage, list->ai_addr, list->ai_addrlen);
  freeaddrinfo(list);
  return address;
}

int new_socket(const SocketAddress& address, int type) {
  return socket(address.storage.ss_family, type | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
}

Outcome outcome_of(ssize_t result, std::size_t& size) {
  size = result > 0 ? static_cast<std::size_t>(result) : 0;
  if (result >= 0) return Outcome::done;
  return would_block(errno) ? Outcome::later : Outcome::broken;
}

/// A UDP socket. The network may lose what is sent; that the other end isn't there is no reason to
/// give up.
class Udp : public Endpoint {
 public:
  /// Without a `peer` it listens at `local`.
  Udp(const std::string& description, std::optional<SocketAddress> local,
      std::optional<SocketAddress> peer)
      : local_(local), peer_(peer) {
    if (!open()) throw Error(description + ": " + system_message(errno));
  }

  bool open() final {
    socket_.reset(new_socket(local_ ? *local_ : *peer_, SOCK_DGRAM));
    if (!socket_.open()) return false;
    return !local_ || bind(socket_.get(), local_->get(), local_->size) == 0;
  }

  void close() override { socket_.reset(); }
  int descriptor() const override { return socket_.get(); }
  bool ready() override { return socket_.open() && peer_.has_value(); }
  bool datagrams() const override { return true; }

  Outcome write(const std::uint8_t* bytes, std::size_t& size) override {
    const ssize_t sent =
        sendto(socket_.get(), bytes, size, MSG_DONTWAIT | MSG_NOSIGNAL, peer_->get(), peer_->size);
    const Outcome outcome = outcome_of(sent, size);
    return outcome == Outcome::broken ? Outcome::later : outcome;
  }

  Outcome read(std::uint8_t* bytes, std::size_t& size) override {
    sender_ = SocketAddress();
    const ssize_t got =
        recvfrom(socket_.get(), bytes, size, MSG_DONTWAIT, sender_.get(), &sender_.size);
    const Outcome outcome = outcome_of(got, size);
    if (outcome == Outcome::broken) return Outcome::later;
    if (outcome == Outcome::done && !(peer_ && *peer_ == sender_)) return Outcome::strange;
    return outcome;
  }

  void adopt() override {
    if (local_) peer_ = sender_;
  }
  void forget() override {
    if (local_) peer_.reset();
  }

 private:
  std::optional<SocketAddress> local_, peer_;
  SocketAddress sender_;
  Descriptor socket_;
};

class Tcp : public Endpoint {
 public:
  explicit Tcp(SocketAddress server) : server_(server) {}

  bool open() override {
    connected_ = false;
    socket_.reset(new_socket(server_, SOCK_STREAM));
    if (!socket_.open()) return false;
    const int yes = 1;
    setsockopt(socket_.get(), IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    // To close means to throw away what wasn't sent.
    const linger at_once{1, 0};
    setsockopt(socket_.get(), SOL_SOCKET, SO_LINGER, &at_once, sizeof at_once);
    if (connect(socket_.get(), server_.get(), server_.size) == 0 || errno == EINPROGRESS)
      return true;
    close();
    return false;
  }

  void close() override {
    connected_ = false;
    socket_.reset();
  }

  int descriptor() const override { return socket_.get(); }

  bool ready() override {
    if (connected_ || !socket_.open()) return connected_;
    int error = 0;
    socklen_t size = sizeof error;
    getsockopt(socket_.get(), SOL_SOCKET, SO_ERROR, &error, &size);
    if (error != 0) {
      close();
      return false;
    }
    SocketAddress peer;
    connected_ = getpeername(socket_.get(), peer.get(), &peer.size) == 0;
    return connected_;
  }

  bool datagrams() const override { return false; }

  Outcome write(const std::uint8_t* bytes, std::size_t& size) override {
    return outcome_of(::send(socket_.get(), bytes, size, MSG_DONTWAIT | MSG_NOSIGNAL), size);
  }

  Outcome read(std::uint8_t* bytes, std::size_t& size) override {
    const Outcome outcome = outcome_of(recv(socket_.get(), bytes, size, MSG_DONTWAIT), size);
    return outcome == Outcome::done && size == 0 ? Outcome::broken : outcome;  // the server left
  }

  std::size_t backlog() const override {
    int bytes = 0;
    return ioctl(socket_.get(), SIOCOUTQ, &bytes) == 0 && bytes > 0
               ? static_cast<std::size_t>(bytes)
               : 0;
  }

 private:
  SocketAddress server_;
  Descriptor socket_;
  bool connected_ = false;
};

struct Baud {
  int rate;
  speed_t speed;
};

constexpr std::array kBauds{
    Baud{9600, B9600},       Baud{19200, B19200},     Baud{38400, B38400},
    Baud{57600, B57600},     Baud{115200, B115200},   Baud{230400, B230400},
    Baud{460800, B460800},   Baud{500000, B500000},   Baud{921600, B921600},
    Baud{1000000, B1000000}, Baud{1500000, B1500000}, Baud{2000000, B2000000},
    Baud{3000000, B3000000}};

class Serial : public Endpoint {
 public:
  Serial(const std::string& description, std::string device, speed_t speed)
      : device_(std::move(device)), speed_(speed) {
    if (!open()) throw Error(description + ": " + device_ + ": " + system_message(errno));
  }

  bool open() final {
    line_.reset(::open(device_.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
    if (!line_.open()) return false;
    termios settings{};
    if (tcgetattr(line_.get(), &settings) != 0) return fail();
    cfmakeraw(&settings);
    settings.c_cflag |= CLOCAL | CREAD;
    settings.c_cflag &= ~static_cast<tcflag_t>(CRTSCTS | CSTOPB);
    cfsetispeed(&settings, speed_);
    cfsetospeed(&settings, speed_);
    return tcsetattr(line_.get(), TCSANOW, &settings) == 0 || fail();
  }

  void close() override {
    if (line_.open()) tcflush(line_.get(), TCOFLUSH);
    line_.reset();
  }

  int descriptor() const override { return line_.get(); }
  bool ready() override { return line_.open(); }
  bool datagrams() const override { return false; }

  Outcome write(const std::uint8_t* bytes, std::size_t& size) override {
    return outcome_of(::write(line_.get(), bytes, size), size);
  }

  Outcome read(std::uint8_t* bytes, std::size_t& size) override {
    const Outcome outcome = outcome_of(::read(line_.get(), bytes, size), size);
    return outcome == Outcome::done && size == 0 ? Outcome::broken : outcome;  // it was unplugged
  }

  std::size_t backlog() const override {
    int bytes = 0;
    return ioctl(line_.get(), TIOCOUTQ, &bytes) == 0 && bytes > 0 ? static_cast<std::size_t>(bytes)
                                                                  : 0;
  }

 private:
  bool fail() {
    const int error = errno;
    line_.reset();
    errno = error;
    return false;
  }

  std::string device_;
  speed_t speed_;
  Descriptor line_;
};

speed_t speed_of(const std::string& description, const std::string& word) {
  int rate = 0;
  const auto [end, failed] = std::from_chars(word.data(), word.data() + word.size(), rate);
  if (failed == std::errc{} && end == word.data() + word.size())
    for (const Baud& baud : kBauds)
      if (baud.rate == rate) return baud.speed;
  throw Error(description + ": '" + word + "' is no baud rate (57600, 115200, 921600, ...)");
}

}  // namespace

void Descriptor::reset(int fd) {
  if (fd_ >= 0) ::close(fd_);
  fd_ = fd;
}

std::unique_ptr<Endpoint> make_endpoint(const std::string& description) {
  const std::size_t first = description.find(':');
  const std::size_t last = description.rfind(':');
  if (first == std::string::npos || first == last || last + 1 == description.size())
    throw Error(description +
                ": is no link (udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT, "
                "serial:DEVICE:BAUD)");
  const std::string kind = description.substr(0, first);
  std::string place = description.substr(first + 1, last - first - 1);
  const std::string number = description.substr(last + 1);
  if (kind == "serial")
    return std::make_unique<Serial>(description, place, speed_of(description, number));

  if (place.size() > 2 && place.front() == '[' && place.back() == ']')
    place = place.substr(1, place.size() - 2);
  unsigned port = 0;
  const auto [end, failed] = std::from_chars(number.data(), number.data() + number.size(), port);
  if (failed != std::errc{} || end != number.data() + number.size() || port > 65535 ||
      (port == 0 && kind != "udpin"))
    throw Error(description + ": '" + number + "' is no port");
  if (kind == "udpin")
    return std::make_unique<Udp>(description, resolve(description, place, number, true),
                                 std::nullopt);
  if (kind == "udpout")
    return std::make_unique<Udp>(description, std::nullopt,
                                 resolve(description, place, number, false));
  if (kind == "tcp") return std::make_unique<Tcp>(resolve(description, place, number, false));
  throw Error(description + ": '" + kind + "' is no kind of link (udpin, udpout, tcp, serial)");
}

}  // namespace harco::mavlink
