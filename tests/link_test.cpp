#include "harco/link.hpp"

#include <algorithm>
#include <array>
#include <functional>

#include <gtest/gtest.h>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <pty.h>
#include <sys/socket.h>
#include <unistd.h>

#include "harco/error.hpp"

namespace harco::mavlink {
namespace {

using std::chrono::milliseconds;

/// A socket of the test's own, on the loopback.
class Socket {
 public:
  explicit Socket(int type, int fd = -1) : fd_(fd >= 0 ? fd : socket(AF_INET, type, 0)) {}
  ~Socket() { close(); }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;

  void close() {
    if (fd_ >= 0) ::close(fd_);
    fd_ = -1;
  }
  int get() const { return fd_; }

  /// Port 0 lets the system choose one. Returns the port.
  int bind_to(int port) {
    const int yes = 1;
    setsockopt(fd_, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    sockaddr_in address = at(port);
    EXPECT_EQ(bind(fd_, reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    socklen_t size = sizeof address;
    getsockname(fd_, reinterpret_cast<sockaddr*>(&address), &size);
    return ntohs(address.sin_port);
  }
  void send_to(int port, const std::vector<std::uint8_t>& bytes) {
    const sockaddr_in address = at(port);
    sendto(fd_, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&address),
           sizeof address);
  }

 private:
  static sockaddr_in at(int port) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    return address;
  }
  int fd_;
};

int free_port(int type) { return Socket(type).bind_to(0); }

std::string at(const std::string& kind, int port) {
  return kind + ":127.0.0.1:" + std::to_string(port);
}

std::vector<std::uint8_t> frame(const Message& message) {
  const Packet packet = Packer({1, 1}).pack(message);
  return {packet.bytes.begin(), packet.bytes.begin() + static_cast<std::ptrdiff_t>(packet.size)};
}

/// Lets a link work until `enough`, or for three seconds.
bool work(Link& link, std::vector<Received>& heard, const std::function<bool()>& enough) {
  const auto end = std::chrono::steady_clock::now() + milliseconds(3000);
  while (!enough() && std::chrono::steady_clock::now() < end) link.wait(milliseconds(5), -1, heard);
  return enough();
}

StatusText text(const std::string& words) {
  StatusText message;
  message.text = words;
  return message;
}

bool says(const Received& received, const std::string& words) {
  const auto* message = std::get_if<StatusText>(&received.message);
  return message != nullptr && message->text == words;
}

TEST(Link, UdpTalksBothWays) {
  const int port = free_port(SOCK_DGRAM);
  Link vehicle(at("udpin", port)), us(at("udpout", port));
  std::vector<Received> heard, answers;
  EXPECT_FALSE(vehicle.connected()) << "nobody has spoken yet";
  EXPECT_FALSE(vehicle.send(Heartbeat{}));
  EXPECT_TRUE(us.send(text("hello")));
  ASSERT_TRUE(work(vehicle, heard, [&] { return !heard.empty(); }));
  EXPECT_TRUE(says(heard[0], "hello"));
  EXPECT_TRUE(vehicle.send(text("welcome")));
  ASSERT_TRUE(work(us, answers, [&] { return !answers.empty(); }));
  EXPECT_TRUE(says(answers[0], "welcome"));
}

TEST(Link, ListenerKeepsToWhoeverSpokeFirst) {
  const int port = free_port(SOCK_DGRAM);
  LinkOptions options;
  options.forget = milliseconds(200);
  Link link(at("udpin", port), options);
  Socket noise(SOCK_DGRAM), first(SOCK_DGRAM), second(SOCK_DGRAM);
  std::vector<Received> heard;
  noise.send_to(port, {0xFD, 1, 2, 3});
  first.send_to(port, frame(text("first")));
  second.send_to(port, frame(text("second")));
  noise.send_to(port, {1, 2, 3});
  first.send_to(port, frame(text("again")));
  ASSERT_TRUE(work(link, heard, [&] { return heard.size() == 2; }));
  EXPECT_TRUE(says(heard[0], "first"));
  EXPECT_TRUE(says(heard[1], "again"));
  EXPECT_EQ(link.counts().strangers, 4U) << "noise, the first one, the second one, noise";
  // The first one falls silent: after a while another may come.
  ASSERT_TRUE(work(link, heard, [&] { return !link.connected(); }));
  second.send_to(port, frame(text("second")));
  ASSERT_TRUE(work(link, heard, [&] { return heard.size() == 3; }));
  EXPECT_TRUE(link.connected());
}

TEST(Link, UdpDoesntMindThatNobodyListens) {
  Link link(at("udpout", free_port(SOCK_DGRAM)));
  std::vector<Received> heard;
  for (int i = 0; i < 20; ++i) {
    EXPECT_TRUE(link.send(Heartbeat{}));
    link.wait(milliseconds(1), -1, heard);
  }
  EXPECT_TRUE(heard.empty());
}

/// A server whose ends may be pulled at any moment.
class Server {
 public:
  explicit Server(int port, int receive_buffer = 0) : listener_(SOCK_STREAM) {
    if (receive_buffer > 0)
      setsockopt(listener_.get(), SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof receive_buffer);
    listener_.bind_to(port);
    listen(listener_.get(), 4);
  }
  int accept_one() const { return accept(listener_.get(), nullptr, nullptr); }

 private:
  Socket listener_;
};

TEST(Link, TcpWaitsForItsServerAndComesBackToIt) {
  const int port = free_port(SOCK_STREAM);
  LinkOptions options;
  options.retry = milliseconds(20);
  Link link(at("tcp", port), options);
  std::vector<Received> heard;
  for (int i = 0; i < 5; ++i) {
    link.wait(milliseconds(5), -1, heard);
    EXPECT_FALSE(link.send(text("too early")));
  }
  for (int round = 0; round < 2; ++round) {
    const Server server(port);
    ASSERT_TRUE(work(link, heard, [&] { return link.connected(); }));
    Socket vehicle(SOCK_STREAM, server.accept_one());
    // What was sent while nobody was there is gone: the first words are those of now.
    ASSERT_TRUE(link.send(text("now")));
    std::array<std::uint8_t, 200> bytes{};
    const ssize_t size = recv(vehicle.get(), bytes.data(), bytes.size(), 0);
    Parser parser;
    std::vector<Received> got;
    parser.feed(bytes.data(), static_cast<std::size_t>(std::max<ssize_t>(size, 0)), got);
    ASSERT_EQ(got.size(), 1U);
    EXPECT_TRUE(says(got[0], "now"));

    heard.clear();
    const auto answer = frame(text("answer"));
    EXPECT_GT(::send(vehicle.get(), answer.data(), answer.size(), 0), 0);
    ASSERT_TRUE(work(link, heard, [&] { return !heard.empty(); }));
    EXPECT_TRUE(says(heard[0], "answer"));
    vehicle.close();
    ASSERT_TRUE(work(link, heard, [&] { return !link.connected(); }));
    EXPECT_FALSE(link.send(text("into the void")));
  }
  EXPECT_EQ(link.counts().openings, 2U);
  EXPECT_GE(link.counts().dropped, 7U);
}

TEST(Link, WhatAStalledServerDoesntTakeIsThrownAway) {
  const int port = free_port(SOCK_STREAM);
  const Server server(port, 4096);
  LinkOptions options;
  options.retry = milliseconds(10);
  options.stall = milliseconds(60);
  Link link(at("tcp", port), options);
  std::vector<Received> heard;
  ASSERT_TRUE(work(link, heard, [&] { return link.connected(); }));
  const Socket sleeper(SOCK_STREAM, server.accept_one());  // it never reads
  ASSERT_TRUE(work(link, heard, [&] {
    for (int i = 0; i < 100; ++i) link.send(text("a line of text that nobody reads, as it seems"));
    return link.counts().openings == 2;
  }));
  EXPECT_GT(link.counts().dropped, 0U);
}

TEST(Link, SerialLinesWorkUntilTheyArePulled) {
  int master = -1, slave = -1;
  std::array<char, 100> name{};
  ASSERT_EQ(openpty(&master, &slave, name.data(), nullptr, nullptr), 0);
  Socket line(0, master), other(0, slave);
  LinkOptions options;
  options.retry = milliseconds(10);
  Link link("serial:" + std::string(name.data()) + ":115200", options);
  other.close();
  std::vector<Received> heard;
  ASSERT_TRUE(link.connected());
  ASSERT_TRUE(link.send(text("hello")));
  std::array<std::uint8_t, 200> bytes{};
  const ssize_t size = read(line.get(), bytes.data(), bytes.size());
  const auto expected = frame(text("hello"));
  EXPECT_EQ(size, static_cast<ssize_t>(expected.size()));
  // Every byte must pass as it is, those that terminals take for commands too.
  Timesync all;
  all.tc1 = 0x0A0D11131A031C04;
  all.ts1 = 0x7F151216FF0D0A00;
  const auto answer = frame(all);
  EXPECT_EQ(write(line.get(), answer.data(), answer.size()), static_cast<ssize_t>(answer.size()));
  ASSERT_TRUE(work(link, heard, [&] { return !heard.empty(); }));
  EXPECT_EQ(std::get<Timesync>(heard[0].message).ts1, all.ts1);
  line.close();
  ASSERT_TRUE(work(link, heard, [&] { return !link.connected(); }));
  EXPECT_FALSE(link.send(text("gone")));
}

TEST(Link, SignedLinksHearOnlySignedFrames) {
  const int port = free_port(SOCK_DGRAM);
  LinkOptions options;
  options.key = SigningKey::from_pass_phrase("pad");
  Link vehicle(at("udpin", port), options), us(at("udpout", port), options);
  Socket stranger(SOCK_DGRAM);
  std::vector<Received> heard;
  stranger.send_to(port, frame(text("let me in")));
  us.send(text("hello"));
  ASSERT_TRUE(work(vehicle, heard, [&] { return !heard.empty(); }));
  ASSERT_EQ(heard.size(), 1U);
  EXPECT_TRUE(says(heard[0], "hello"));
  EXPECT_EQ(vehicle.counts().received.bad_signature, 1U);
}

TEST(Link, WaitEndsWhenItIsWoken) {
  std::array<int, 2> pipe_ends{};
  ASSERT_EQ(pipe(pipe_ends.data()), 0);
  Link link(at("udpout", free_port(SOCK_DGRAM)));
  const char byte = 1;
  ASSERT_EQ(write(pipe_ends[1], &byte, 1), 1);
  std::vector<Received> heard;
  link.wait(std::chrono::hours(1), pipe_ends[0], heard);  // or this test never ends
  close(pipe_ends[0]);
  close(pipe_ends[1]);
}

TEST(Link, SaysWhatIsWrongWithADescription) {
  for (const char* wrong :
       {"", "udp", "udpin:1", "udpout:127.0.0.1:", "udpout:127.0.0.1:0", "tcp:127.0.0.1:70000",
        "smoke:127.0.0.1:5", "serial:/dev/null:123", "serial:/nonexistent:57600",
        "serial:/dev/null:57600", "tcp:127.0.0.1:12x"}) {
    try {
      const Link link(wrong);
      ADD_FAILURE() << wrong;
    } catch (const Error& error) {
      EXPECT_EQ(std::string(error.what()).rfind(std::string(wrong) + ":", 0), 0U) << error.what();
    }
  }
  const int port = free_port(SOCK_DGRAM);
  const Link first(at("udpin", port));
  EXPECT_THROW(Link second(at("udpin", port)), Error) << "the port is taken";
}

}  // namespace
}  // namespace harco::mavlink
