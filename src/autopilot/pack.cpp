#include <algorithm>
#include <cstring>
#include <type_traits>

#include "frame.hpp"
#include "wire.hpp"

namespace harco::mavlink {
namespace {

/// Writes values one after the other, little-endian.
class Writer {
 public:
  explicit Writer(std::uint8_t* to) : to_(to) {}

  template <typename... Fields>
  void operator()(const Fields&... fields) {
    (write(fields), ...);
  }

  std::size_t size() const { return size_; }

 private:
  template <typename T>
  std::enable_if_t<std::is_integral_v<T>> write(T value) {
    using Bits = std::make_unsigned_t<T>;
    const auto bits = static_cast<std::uint64_t>(static_cast<Bits>(value));
    for (std::size_t i = 0; i < sizeof(T); ++i)
      to_[size_++] = static_cast<std::uint8_t>(bits >> (8 * i));
  }

  void write(float value) {
    std::uint32_t bits = 0;
    std::memcpy(&bits, &value, sizeof bits);
    write(bits);
  }

  template <typename T, std::size_t N>
  void write(const std::array<T, N>& values) {
    for (const T& value : values) write(value);
  }

  void write(const std::string& text) {
    for (std::size_t i = 0; i < kStatusTextLength; ++i)
      to_[size_++] = i < text.size() ? static_cast<std::uint8_t>(text[i]) : std::uint8_t{0};
  }

  std::uint8_t* to_;
  std::size_t size_ = 0;
};

/// The payload's length without its trailing zeros; one byte always stays.
std::size_t truncated(const std::uint8_t* payload, std::size_t size) {
  while (size > 1 && payload[size - 1] == 0) --size;
  return size;
}

}  // namespace

const char* name_of(const Message& message) {
  return std::visit([](const auto& m) { return Wire<std::decay_t<decltype(m)>>::name; }, message);
}

void Packer::sign_with(const SigningKey& key, std::uint8_t link_id) {
  key_ = key;
  link_id_ = link_id;
}

Packet Packer::pack(const Message& message, std::uint64_t unix_time_us) {
  Packet packet;
  std::uint8_t* const bytes = packet.bytes.data();
  std::uint32_t id = 0;
  std::uint8_t crc_extra = 0;
  Writer payload(bytes + kHeader2);
  std::visit(
      [&](const auto& m) {
        using Layout = Wire<std::decay_t<decltype(m)>>;
        id = Layout::id;
        crc_extra = Layout::crc_extra;
        Layout::fields(m, [&](const auto&... fields) { payload(fields...); });
      },
      message);
  const std::size_t length = truncated(bytes + kHeader2, payload.size());

  Writer header(bytes);
  header(kMagic2, static_cast<std::uint8_t>(length), key_ ? kSignedFlag : std::uint8_t{0},
         std::uint8_t{0}, sequence_++, from_.system, from_.component,
         static_cast<std::uint16_t>(id), static_cast<std::uint8_t>(id >> 16));
  packet.size = kHeader2 + length;
  Writer tail(bytes + packet.size);
  tail(checksum(bytes + 1, packet.size - 1, crc_extra));
  if (key_) {
    signed_at_ = std::max(signed_at_ + 1, signature_time(unix_time_us));
    tail(link_id_, static_cast<std::uint32_t>(signed_at_),
         static_cast<std::uint16_t>(signed_at_ >> 32));
    tail(signature_hash(*key_, bytes, packet.size + tail.size()));
  }
  packet.size += tail.size();
  return packet;
}

}  // namespace harco::mavlink
