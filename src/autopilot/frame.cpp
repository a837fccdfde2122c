#include "frame.hpp"

#include <algorithm>
#include <memory>
#include <stdexcept>

#include <openssl/evp.h>

namespace harco::mavlink {
namespace {

constexpr std::uint64_t kUnixTimeOf2015Us = 1420070400ULL * 1000000ULL;

class Sha256 {
 public:
  Sha256() : context_(EVP_MD_CTX_new()) {
    if (!context_ || EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr) != 1)
      throw std::runtime_error("SHA-256 is not available");
  }

  void add(const void* bytes, std::size_t size) {
    if (EVP_DigestUpdate(context_.get(), bytes, size) != 1)
      throw std::runtime_error("SHA-256 failed");
  }

  std::array<std::uint8_t, 32> result() {
    std::array<std::uint8_t, 32> hash{};
    if (EVP_DigestFinal_ex(context_.get(), hash.data(), nullptr) != 1)
      throw std::runtime_error("SHA-256 failed");
    return hash;
  }

 private:
  struct Free {
    void operator()(EVP_MD_CTX* context) const { EVP_MD_CTX_free(context); }
  };
  std::unique_ptr<EVP_MD_CTX, Free> context_;
};

std::uint16_t accumulate(std::uint16_t crc, std::uint8_t byte) {
  const auto mixed = static_cast<std::uint8_t>(byte ^ (crc & 0xFFU));
  const auto folded = static_cast<std::uint8_t>(mixed ^ (mixed << 4));
  return static_cast<std::uint16_t>((crc >> 8) ^ (folded << 8) ^ (folded << 3) ^ (folded >> 4));
}

}  // namespace

std::uint16_t checksum(const std::uint8_t* bytes, std::size_t size, std::uint8_t crc_extra) {
  std::uint16_t crc = 0xFFFF;
  for (std::size_t i = 0; i < size; ++i) crc = accumulate(crc, bytes[i]);
  return accumulate(crc, crc_extra);
}

std::array<std::uint8_t, 6> signature_hash(const SigningKey& key, const std::uint8_t* frame,
                                           std::size_t size) {
  Sha256 sha;
  sha.add(key.bytes.data(), key.bytes.size());
  sha.add(frame, size);
  const auto all = sha.result();
  std::array<std::uint8_t, 6> first{};
  std::copy_n(all.begin(), first.size(), first.begin());
  return first;
}

std::uint64_t signature_time(std::uint64_t unix_time_us) {
  return unix_time_us > kUnixTimeOf2015Us ? (unix_time_us - kUnixTimeOf2015Us) / 10 : 0;
}

SigningKey SigningKey::from_pass_phrase(const std::string& phrase) {
  Sha256 sha;
  sha.add(phrase.data(), phrase.size());
  return {sha.result()};
}

}  // namespace harco::mavlink
