#include <algorithm>
#include <cstring>
#include <type_traits>
#include <utility>

#include "frame.hpp"
#include "wire.hpp"

namespace harco::mavlink {
namespace {

/// A minute: a sender that is heard for the first time may be so far behind the newest signature.
constexpr std::uint64_t kMostBehind = 6000000;
/// As many senders and links are told apart; the keepers of the key have no need for more.
constexpr std::size_t kMostStreams = 32;

/// Reads values one after the other, little-endian; zeros beyond the payload's end, as version 2
/// wants.
class Reader {
 public:
  Reader(const std::uint8_t* payload, std::size_t size) : payload_(payload), size_(size) {}

  template <typename... Fields>
  void operator()(Fields&... fields) {
    (read(fields), ...);
  }

 private:
  std::uint8_t byte() {
    const std::size_t at = at_++;
    return at < size_ ? payload_[at] : std::uint8_t{0};
  }

  template <typename T>
  std::enable_if_t<std::is_integral_v<T>> read(T& value) {
    std::uint64_t bits = 0;
    for (std::size_t i = 0; i < sizeof(T); ++i) bits |= std::uint64_t{byte()} << (8 * i);
    value = static_cast<T>(static_cast<std::make_unsigned_t<T>>(bits));
  }

  void read(float& value) {
    std::uint32_t bits = 0;
    read(bits);
    std::memcpy(&value, &bits, sizeof value);
  }

  template <typename T, std::size_t N>
  void read(std::array<T, N>& values) {
    for (T& value : values) read(value);
  }

  void read(std::string& text) {
    text.clear();
    for (std::size_t i = 0; i < kStatusTextLength; ++i)
      if (const char c = static_cast<char>(byte()); c != '\0' && text.size() == i)
        text.push_back(c);
  }

  const std::uint8_t* payload_;
  std::size_t size_;
  std::size_t at_ = 0;
};

/// What is known of a kind of message before its payload is looked at.
struct Kind {
  std::uint32_t id;
  std::uint8_t crc_extra;
  std::size_t base_length;
  Message (*read)(const std::uint8_t* payload, std::size_t size);
};

template <typename M>
Message read_message(const std::uint8_t* payload, std::size_t size) {
  M message;
  Wire<M>::fields(message, [&](auto&... fields) { Reader(payload, size)(fields...); });
  return message;
}

template <typename... M>
constexpr auto kinds_of(const std::variant<M...>* /*all*/) {
  return std::array<Kind, sizeof...(M)>{
      {{Wire<M>::id, Wire<M>::crc_extra, Wire<M>::base_length, read_message<M>}...}};
}

const Kind* kind_of(std::uint32_t id) {
  static constexpr auto kinds = kinds_of(static_cast<const Message*>(nullptr));
  const auto found =
      std::find_if(kinds.begin(), kinds.end(), [&](const Kind& kind) { return kind.id == id; });
  return found == kinds.end() ? nullptr : &*found;
}

std::uint64_t little_endian(const std::uint8_t* bytes, std::size_t size) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < size; ++i) value |= std::uint64_t{bytes[i]} << (8 * i);
  return value;
}

bool is_magic(std::uint8_t byte) { return byte == kMagic1 || byte == kMagic2; }

}  // namespace

void Parser::require_signature(const SigningKey& key) {
  key_ = key;
  streams_.clear();
  newest_ = 0;
}

void Parser::feed(const std::uint8_t* bytes, std::size_t size, std::vector<Received>& out) {
  pending_.insert(pending_.end(), bytes, bytes + size);
  scan(/*more_may_come=*/true, out);
}

void Parser::finish(std::vector<Received>& out) {
  if (!pending_.empty()) ++counts_.truncated;
  scan(/*more_may_come=*/false, out);
  in_step_ = true;
}

void Parser::scan(bool more_may_come, std::vector<Received>& out) {
  std::size_t at = 0;
  while (at < pending_.size()) {
    std::size_t frame = 0;
    Step step = Step::skip_byte;
    if (is_magic(pending_[at]))
      step = examine(pending_.data() + at, pending_.size() - at, frame, out);
    if (step == Step::need_more && more_may_come) break;
    in_step_ = step == Step::skip_frame;
    if (!in_step_) ++counts_.junk_bytes;
    at += in_step_ ? frame : 1;
  }
  pending_.erase(pending_.begin(), pending_.begin() + static_cast<std::ptrdiff_t>(at));
}

/// Looks at what may be a frame. `frame` becomes its length.
Parser::Step Parser::examine(const std::uint8_t* at, std::size_t left, std::size_t& frame,
                             std::vector<Received>& out) {
  const bool version2 = at[0] == kMagic2;
  const std::size_t header = version2 ? kHeader2 : kHeader1;
  if (left < header) return Step::need_more;
  const std::size_t length = at[1];
  const std::uint8_t flags = version2 ? at[2] : std::uint8_t{0};
  const bool is_signed = (flags & kSignedFlag) != 0;
  const std::size_t without_signature = header + length + kCrcLength;
  frame = without_signature + (is_signed ? kSignatureLength : 0);
  if (left < frame) return Step::need_more;

  const auto id = static_cast<std::uint32_t>(version2 ? little_endian(at + 7, 3) : at[5]);
  const Kind* const kind = kind_of(id);
  if (kind == nullptr || (flags & ~kSignedFlag) != 0) {
    // Its checksum can't be checked. Where frames follow one another without a gap it is one.
    if (!in_step_ || (left > frame && !is_magic(at[frame]))) return Step::skip_byte;
    ++counts_.unknown;
    return Step::skip_frame;
  }
  const std::uint16_t crc = checksum(at + 1, header + length - 1, kind->crc_extra);
  if (crc != little_endian(at + header + length, kCrcLength)) {
    ++counts_.bad_crc;
    return Step::skip_byte;
  }
  if (!version2 && length != kind->base_length) {
    ++counts_.truncated;
    return Step::skip_frame;
  }
  if (key_ && !(is_signed && signature_holds(at, without_signature))) {
    ++counts_.bad_signature;
    return Step::skip_frame;
  }
  ++counts_.messages;
  const Address from = version2 ? Address{at[5], at[6]} : Address{at[3], at[4]};
  out.push_back({from, kind->read(at + header, length)});
  return Step::skip_frame;
}

bool Parser::signature_holds(const std::uint8_t* frame, std::size_t without_signature) {
  const std::uint8_t* const signature = frame + without_signature;
  const auto hash = signature_hash(*key_, frame, without_signature + kSignatureHash);
  unsigned differing = 0;  // all bytes are compared, so that time tells nothing
  for (std::size_t i = 0; i < hash.size(); ++i)
    differing |= static_cast<unsigned>(hash[i] ^ signature[kSignatureHash + i]);
  if (differing != 0) return false;

  const Address from{frame[5], frame[6]};
  const std::uint8_t link_id = signature[0];
  const std::uint64_t timestamp = little_endian(signature + 1, 6);
  const auto stream = std::find_if(streams_.begin(), streams_.end(), [&](const Stream& s) {
    return s.from == from && s.link_id == link_id;
  });
  if (stream == streams_.end()) {
    if (timestamp + kMostBehind < newest_ || streams_.size() == kMostStreams) return false;
    streams_.push_back({from, link_id, timestamp});
  } else {
    if (timestamp <= stream->timestamp) return false;
    stream->timestamp = timestamp;
  }
  newest_ = std::max(newest_, timestamp);
  return true;
}

}  // namespace harco::mavlink
