#include "harco/mavlink.hpp"

#include <algorithm>
#include <cstring>
#include <limits>
#include <random>

#include <gtest/gtest.h>

#include "autopilot/frame.hpp"
#include "sample_messages.hpp"

namespace harco::mavlink {
namespace {

using test::fields_of;
using test::random_messages;

std::vector<Received> parse(Parser& parser, const Packet& packet) {
  std::vector<Received> out;
  parser.feed(packet.bytes.data(), packet.size, out);
  return out;
}

std::vector<std::uint8_t> joined(const std::vector<Packet>& packets) {
  std::vector<std::uint8_t> bytes;
  for (const Packet& p : packets)
    bytes.insert(bytes.end(), p.bytes.begin(),
                 p.bytes.begin() + static_cast<std::ptrdiff_t>(p.size));
  return bytes;
}

/// The frame with its checksum made right again, after something in it was changed.
void mend(Packet& packet, std::uint8_t crc_extra) {
  const std::size_t end = kHeader2 + packet.bytes[1];
  const std::uint16_t crc = checksum(packet.bytes.data() + 1, end - 1, crc_extra);
  packet.bytes[end] = static_cast<std::uint8_t>(crc);
  packet.bytes[end + 1] = static_cast<std::uint8_t>(crc >> 8);
}

constexpr std::uint8_t kHeartbeatSeed = 50;

TEST(Mavlink, ChecksumIsCrc16Mcrf4xx) {
  // The check value of that CRC: of "123456789" it is 0x6F91; the seed comes last.
  const std::string digits = "12345678";
  EXPECT_EQ(checksum(reinterpret_cast<const std::uint8_t*>(digits.data()), 8, '9'), 0x6F91);
}

TEST(Mavlink, FrameIsLaidOutAsTheStandardSays) {
  Packer packer({1, 191});
  Heartbeat heartbeat;
  heartbeat.custom_mode = 0x01020304;
  heartbeat.type = 18;
  heartbeat.autopilot = 8;
  heartbeat.system_status = 4;
  const Packet packet = packer.pack(heartbeat);
  const std::vector<std::uint8_t> expected{0xFD, 9, 0, 0, 0,  1, 191, 0, 0, 0,  // header
                                           4,    3, 2, 1, 18, 8, 0,   4, 3};    // payload
  ASSERT_EQ(packet.size, expected.size() + 2);
  EXPECT_TRUE(std::equal(expected.begin(), expected.end(), packet.bytes.begin()));
  EXPECT_EQ(packer.pack(heartbeat).bytes[4], 1) << "frames are numbered";
}

TEST(Mavlink, TrailingZerosAreLeftOut) {
  Packer packer;
  Timesync question;
  question.ts1 = 0x0102;
  // tc1 is eight zeros before it; of ts1 two bytes are left; the targets are zero.
  EXPECT_EQ(packer.pack(question).size, kHeader2 + 10 + kCrcLength);
  EXPECT_EQ(packer.pack(ExtendedSysState{}).size, kHeader2 + 1 + kCrcLength) << "one byte stays";
}

TEST(Mavlink, TextIsCutAtFiftyBytes) {
  Packer packer;
  Parser parser;
  StatusText text;
  text.text = std::string(70, 'x');
  const auto got = parse(parser, packer.pack(text));
  ASSERT_EQ(got.size(), 1U);
  EXPECT_EQ(std::get<StatusText>(got[0].message).text, std::string(50, 'x'));
}

TEST(Mavlink, EveryMessageComesBackAsItWentOut) {
  std::mt19937 random(1);
  for (const bool is_signed : {false, true}) {
    Packer packer({7, 42});
    Parser parser;
    if (is_signed) {
      const SigningKey key = SigningKey::from_pass_phrase("deck");
      packer.sign_with(key, 3);
      parser.require_signature(key);
    }
    int count = 0;
    for (int round = 0; round < 50; ++round)
      for (const Message& message : random_messages(random)) {
        const auto got = parse(parser, packer.pack(message, 1700000000000000ULL));
        ASSERT_EQ(got.size(), 1U) << name_of(message);
        EXPECT_EQ(got[0].from, (Address{7, 42}));
        EXPECT_EQ(fields_of(got[0].message), fields_of(message));
        ++count;
      }
    EXPECT_EQ(parser.counts().messages, static_cast<std::uint64_t>(count));
    EXPECT_EQ(parser.counts().junk_bytes + parser.counts().bad_crc, 0U);
  }
}

TEST(Mavlink, FramesOfVersion1AreUnderstood) {
  // TIMESYNC of version 1: magic, length, sequence, system, component, number, payload, checksum.
  std::vector<std::uint8_t> frame{0xFE, 16, 5, 1, 1, 111};
  for (std::uint8_t i = 1; i <= 16; ++i) frame.push_back(i);
  const std::uint16_t crc = checksum(frame.data() + 1, frame.size() - 1, 34);
  frame.push_back(static_cast<std::uint8_t>(crc));
  frame.push_back(static_cast<std::uint8_t>(crc >> 8));
  Parser parser;
  std::vector<Received> out;
  parser.feed(frame.data(), frame.size(), out);
  ASSERT_EQ(out.size(), 1U);
  EXPECT_EQ(out[0].from, (Address{1, 1}));
  EXPECT_EQ(std::get<Timesync>(out[0].message).tc1, 0x0807060504030201);
  EXPECT_EQ(std::get<Timesync>(out[0].message).ts1, 0x100F0E0D0C0B0A09);
}

TEST(Mavlink, BytesMayComeInPiecesOfAnySize) {
  std::mt19937 random(2);
  Packer packer;
  std::vector<Packet> packets;
  std::vector<std::vector<double>> sent;
  for (int round = 0; round < 20; ++round)
    for (const Message& message : random_messages(random)) {
      packets.push_back(packer.pack(message));
      sent.push_back(fields_of(message));
    }
  const std::vector<std::uint8_t> bytes = joined(packets);
  Parser parser;
  std::vector<Received> out;
  for (std::size_t at = 0; at < bytes.size();) {
    const std::size_t piece = std::min<std::size_t>(random() % 40, bytes.size() - at);
    parser.feed(bytes.data() + at, piece, out);
    at += piece;
  }
  ASSERT_EQ(out.size(), sent.size());
  for (std::size_t i = 0; i < out.size(); ++i) EXPECT_EQ(fields_of(out[i].message), sent[i]);
}

TEST(Mavlink, GarbageBetweenFramesLosesNone) {
  std::mt19937 random(3);
  Packer packer;
  std::vector<std::uint8_t> bytes;
  std::size_t sent = 0;
  for (int round = 0; round < 200; ++round) {
    // Among the garbage, many bytes that begin a frame.
    bytes.push_back(0);
    for (auto i = random() % 60; i > 0; --i)
      bytes.push_back(random() % 4 == 0 ? kMagic2 : static_cast<std::uint8_t>(random()));
    for (const Message& message : random_messages(random)) {
      const Packet p = packer.pack(message);
      bytes.insert(bytes.end(), p.bytes.begin(),
                   p.bytes.begin() + static_cast<std::ptrdiff_t>(p.size));
      ++sent;
    }
  }
  bytes.insert(bytes.end(), 300, 0);  // whatever a false beginning waits for
  Parser parser;
  std::vector<Received> out;
  parser.feed(bytes.data(), bytes.size(), out);
  EXPECT_EQ(out.size(), sent);
  EXPECT_EQ(parser.counts().unknown, 0U);
  EXPECT_GT(parser.counts().junk_bytes, 300U);
}

TEST(Mavlink, OneWrongBitIsNoticedEverywhere) {
  Packer packer;
  LandingTarget target;
  target.x = 1.5F;
  target.position_valid = 1;
  const Packet good = packer.pack(target);
  for (std::size_t byte = 0; byte < good.size; ++byte)
    for (int bit = 0; bit < 8; ++bit) {
      Packet bad = good;
      bad.bytes[byte] = static_cast<std::uint8_t>(bad.bytes[byte] ^ (1U << bit));
      Parser parser;
      std::vector<Received> none;
      EXPECT_TRUE(parse(parser, bad).empty()) << byte << " " << bit;
      parser.finish(none);
      EXPECT_TRUE(none.empty());
      const ParserCounts& c = parser.counts();
      EXPECT_GT(c.unknown + c.bad_crc + c.truncated + c.junk_bytes, 0U) << byte << " " << bit;
    }
}

TEST(Mavlink, WhatIsUnknownIsSkippedWhole) {
  Packer packer;
  Packet other = packer.pack(Heartbeat{});
  other.bytes[7] = 200;  // a message that isn't known here: nobody can check its checksum
  const Packet good = packer.pack(Heartbeat{});
  Parser parser;
  std::vector<Received> out;
  const auto bytes = joined({other, good});
  parser.feed(bytes.data(), bytes.size(), out);
  EXPECT_EQ(out.size(), 1U);
  EXPECT_EQ(parser.counts().unknown, 1U);
  EXPECT_EQ(parser.counts().junk_bytes, 0U);

  Packet future = packer.pack(Heartbeat{});
  future.bytes[2] = 0x02;  // a flag that must be understood, and isn't
  mend(future, kHeartbeatSeed);
  EXPECT_TRUE(parse(parser, future).empty());
  EXPECT_EQ(parser.counts().unknown, 2U);
}

TEST(Mavlink, LongerAndShorterPayloadsOfVersion2AreFilledOrCut) {
  Packer packer;
  Packet longer = packer.pack(Heartbeat{});  // nine bytes, the last of which is 3
  longer.bytes[1] = 12;                      // a later standard's extension
  longer.size += 3;
  mend(longer, kHeartbeatSeed);
  Parser parser;
  const auto got = parse(parser, longer);
  ASSERT_EQ(got.size(), 1U);
  EXPECT_EQ(std::get<Heartbeat>(got[0].message).mavlink_version, 3);
}

TEST(Mavlink, DatagramsThatEndTooEarlyAreDropped) {
  Packer packer;
  const Packet packet = packer.pack(Heartbeat{});
  Parser parser;
  std::vector<Received> out;
  parser.feed(packet.bytes.data(), packet.size - 1, out);
  parser.finish(out);
  EXPECT_EQ(parser.counts().truncated, 1U);
  EXPECT_EQ(parse(parser, packet).size(), 1U) << "the next one is whole again";
  EXPECT_TRUE(out.empty());
}

TEST(Mavlink, FalseBeginningsHideNothingInADatagram) {
  Packer packer;
  const Packet good = packer.pack(Heartbeat{});
  std::vector<std::uint8_t> bytes{0, kMagic2, 255};  // promises 255 bytes that never come
  bytes.insert(bytes.end(), good.bytes.begin(),
               good.bytes.begin() + static_cast<std::ptrdiff_t>(good.size));
  Parser parser;
  std::vector<Received> out;
  parser.feed(bytes.data(), bytes.size(), out);
  EXPECT_TRUE(out.empty());
  parser.finish(out);
  EXPECT_EQ(out.size(), 1U);
}

class Signatures : public testing::Test {
 protected:
  Signatures() {
    packer.sign_with(key, 1);
    parser.require_signature(key);
  }
  std::size_t accepted(const Packet& packet) { return parse(parser, packet).size(); }

  static constexpr std::uint64_t kNow = 1800000000000000ULL;
  SigningKey key = SigningKey::from_pass_phrase("correct horse");
  Packer packer{{1, 1}};
  Parser parser;
};

TEST_F(Signatures, KeyIsTheSha256OfThePassPhrase) {
  // echo -n abc | sha256sum
  const SigningKey abc = SigningKey::from_pass_phrase("abc");
  EXPECT_EQ(abc.bytes[0], 0xba);
  EXPECT_EQ(abc.bytes[1], 0x78);
  EXPECT_EQ(abc.bytes[31], 0xad);
}

TEST_F(Signatures, OnlyTheirKeepersAreHeard) {
  EXPECT_EQ(accepted(packer.pack(Heartbeat{}, kNow)), 1U);
  EXPECT_EQ(accepted(Packer({1, 1}).pack(Heartbeat{})), 0U) << "not signed";
  Packer stranger({1, 1});
  stranger.sign_with(SigningKey::from_pass_phrase("guess"), 1);
  EXPECT_EQ(accepted(stranger.pack(Heartbeat{}, kNow + 1000000)), 0U);
  Packet changed = packer.pack(Heartbeat{}, kNow + 2000000);
  changed.bytes[kHeader2] = 9;
  mend(changed, kHeartbeatSeed);
  EXPECT_EQ(accepted(changed), 0U);
  EXPECT_EQ(parser.counts().bad_signature, 3U);
}

TEST_F(Signatures, NothingIsAcceptedTwice) {
  const Packet first = packer.pack(Heartbeat{}, kNow);
  const Packet second = packer.pack(Heartbeat{}, kNow);  // same time given: the stamp rises
  EXPECT_EQ(accepted(first), 1U);
  EXPECT_EQ(accepted(first), 0U);
  EXPECT_EQ(accepted(second), 1U);
  EXPECT_EQ(accepted(first), 0U);
  EXPECT_EQ(parser.counts().bad_signature, 2U);
}

TEST_F(Signatures, NewSendersMustNotComeFromThePast) {
  EXPECT_EQ(accepted(packer.pack(Heartbeat{}, kNow)), 1U);
  Packer late({1, 2}), fresh({1, 3});
  late.sign_with(key, 1);
  fresh.sign_with(key, 1);
  EXPECT_EQ(accepted(late.pack(Heartbeat{}, kNow - 61000000)), 0U);
  EXPECT_EQ(accepted(fresh.pack(Heartbeat{}, kNow - 59000000)), 1U);
}

TEST_F(Signatures, SignedFramesAreReadWithoutAKeyToo) {
  Parser open;
  EXPECT_EQ(parse(open, packer.pack(Heartbeat{}, kNow)).size(), 1U);
}

TEST(MavlinkFuzz, NoBytesDoHarm) {
  // Frames with some bytes changed, cut, doubled: the parser stays in its bounds (sanitizers watch)
  // and what it lets through is finite in number.
  std::mt19937 random(4);
  Packer packer;
  packer.sign_with(SigningKey::from_pass_phrase("a"));
  Parser parser, strict;
  strict.require_signature(SigningKey::from_pass_phrase("b"));
  std::vector<Received> out, none;
  std::size_t fed = 0;
  for (int round = 0; round < 3000; ++round) {
    std::vector<Packet> packets;
    for (const Message& message : random_messages(random))
      if (random() % 3 == 0) packets.push_back(packer.pack(message));
    std::vector<std::uint8_t> bytes = joined(packets);
    for (auto i = random() % 4; i > 0 && !bytes.empty(); --i)
      bytes[random() % bytes.size()] = static_cast<std::uint8_t>(random());
    if (random() % 4 == 0) bytes.resize(random() % (bytes.size() + 1));
    parser.feed(bytes.data(), bytes.size(), out);
    strict.feed(bytes.data(), bytes.size(), none);
    fed += bytes.size();
    if (random() % 8 == 0) parser.finish(out);
  }
  EXPECT_TRUE(none.empty()) << "the key is another";
  EXPECT_GT(out.size(), 1000U);
  EXPECT_LT(out.size(), fed / 12);
}

}  // namespace
}  // namespace harco::mavlink
