// Any bytes into the MAVLink parser, in pieces, with and without a key; the same bytes as the
// payload of every kind of message; what comes out goes through the packer and back. For libFuzzer:
// mavlink_fuzz -max_total_time=60
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>

#include "autopilot/frame.hpp"
#include "sample_messages.hpp"

namespace {

using namespace harco::mavlink;  // NOLINT(google-build-using-namespace): a program of one page

void check(bool holds) {
  if (!holds) std::abort();
}

void parse_as_a_stream(const std::uint8_t* data, std::size_t size, std::vector<Received>& out) {
  Parser whole, pieces, strict;
  strict.require_signature(SigningKey::from_pass_phrase("fuzz"));
  std::vector<Received> same, none;
  whole.feed(data, size, out);
  whole.finish(out);
  const std::size_t half = size > 0 ? data[0] % size : 0;
  pieces.feed(data, half, same);
  pieces.feed(data + half, size - half, same);
  pieces.finish(same);
  strict.feed(data, size, none);
  strict.finish(none);
  check(none.empty());  // nobody guesses a signature
}

/// The bytes as payload of a message of the kind of `model`, with a checksum that is right.
template <typename M>
void parse_as_payload(const M& /*model*/, const std::uint8_t* data, std::size_t size,
                      std::vector<Received>& out) {
  const std::size_t length = std::min(size, kMostPayload);
  std::vector<std::uint8_t> frame{kMagic2, static_cast<std::uint8_t>(length), 0, 0, 0, 1, 1};
  for (int i = 0; i < 3; ++i) frame.push_back(static_cast<std::uint8_t>(Wire<M>::id >> (8 * i)));
  frame.insert(frame.end(), data, data + length);
  const std::uint16_t crc = checksum(frame.data() + 1, frame.size() - 1, Wire<M>::crc_extra);
  frame.push_back(static_cast<std::uint8_t>(crc));
  frame.push_back(static_cast<std::uint8_t>(crc >> 8));
  const std::size_t before = out.size();
  Parser().feed(frame.data(), frame.size(), out);
  check(out.size() == before + 1);
}

template <std::size_t... I>
void parse_as_payloads(const std::uint8_t* data, std::size_t size, std::vector<Received>& out,
                       std::index_sequence<I...> /*kinds*/) {
  (parse_as_payload(std::variant_alternative_t<I, Message>{}, data, size, out), ...);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::vector<Received> out;
  parse_as_a_stream(data, size, out);
  parse_as_payloads(data, size, out, std::make_index_sequence<std::variant_size_v<Message>>{});
  Packer packer;
  for (const Received& received : out) {
    const Packet packet = packer.pack(received.message);
    std::vector<Received> back;
    Parser().feed(packet.bytes.data(), packet.size, back);
    check(back.size() == 1 && back[0].message.index() == received.message.index());
  }
  return 0;
}
