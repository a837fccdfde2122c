// What packing and parsing share of a frame's layout: offsets, checksum, signature.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "harco/mavlink.hpp"

namespace harco::mavlink {

inline constexpr std::uint8_t kMagic1 = 0xFE, kMagic2 = 0xFD;
/// Before the payload: magic, length, [incompatible flags, compatible flags,] sequence, system,
/// component, message number (1 byte or 3).
inline constexpr std::size_t kHeader1 = 6, kHeader2 = 10;
inline constexpr std::size_t kCrcLength = 2;
/// Link, 48 bits of time, 48 bits of hash.
inline constexpr std::size_t kSignatureLength = 13, kSignatureHash = 7;
inline constexpr std::uint8_t kSignedFlag = 0x01;
inline constexpr std::size_t kMostPayload = 255;

/// CRC-16/MCRF4XX of the bytes, then of the message's seed.
std::uint16_t checksum(const std::uint8_t* bytes, std::size_t size, std::uint8_t crc_extra);

/// The first 48 bits of the SHA-256 of the key and the frame up to them.
std::array<std::uint8_t, 6> signature_hash(const SigningKey& key, const std::uint8_t* frame,
                                           std::size_t size);

/// Ten microseconds of 2015 and later, as signatures count time.
std::uint64_t signature_time(std::uint64_t unix_time_us);

}  // namespace harco::mavlink
