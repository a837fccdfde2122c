// One message of every kind with random fields, and the fields as numbers, in wire order.
#pragma once

#include <array>
#include <random>
#include <string>
#include <vector>

#include "autopilot/wire.hpp"
#include "harco/mavlink.hpp"

namespace harco::mavlink::test {

/// Puts random values into fields. Now and then zero, so that payloads end in zeros.
class RandomFields {
 public:
  explicit RandomFields(std::mt19937& random) : random_(random) {}

  template <typename... Fields>
  void operator()(Fields&... fields) const {
    (fill(fields), ...);
  }

 private:
  template <typename T>
  std::enable_if_t<std::is_integral_v<T>> fill(T& value) const {
    // Below 2^53, so that numbers of any language hold it.
    const std::uint64_t bits = (std::uint64_t{random_()} << 20) ^ random_();
    value = random_() % 4 == 0 ? T{0} : static_cast<T>(bits);
  }
  void fill(float& value) const {
    value = random_() % 4 == 0 ? 0.0F : std::normal_distribution<float>(0.0F, 100.0F)(random_);
  }
  template <typename T, std::size_t N>
  void fill(std::array<T, N>& values) const {
    for (T& value : values) fill(value);
  }
  void fill(std::string& text) const {
    text.clear();
    for (std::size_t i = random_() % (kStatusTextLength + 1); i > 0; --i)
      text.push_back(static_cast<char>('a' + random_() % 26));
  }

  std::mt19937& random_;
};

template <std::size_t... I>
std::vector<Message> random_messages(std::mt19937& random, std::index_sequence<I...> /*kinds*/) {
  const auto one = [&](auto message) -> Message {
    Wire<decltype(message)>::fields(message, RandomFields(random));
    return message;
  };
  return {one(std::variant_alternative_t<I, Message>{})...};
}

inline std::vector<Message> random_messages(std::mt19937& random) {
  return random_messages(random, std::make_index_sequence<std::variant_size_v<Message>>{});
}

/// Collects fields as numbers; a text as its characters, zeros behind them.
class FieldList {
 public:
  explicit FieldList(std::vector<double>& to) : to_(to) {}

  template <typename... Fields>
  void operator()(const Fields&... fields) const {
    (add(fields), ...);
  }

 private:
  template <typename T>
  std::enable_if_t<std::is_arithmetic_v<T>> add(T value) const {
    to_.push_back(static_cast<double>(value));
  }
  template <typename T, std::size_t N>
  void add(const std::array<T, N>& values) const {
    for (const T& value : values) add(value);
  }
  void add(const std::string& text) const {
    for (std::size_t i = 0; i < kStatusTextLength; ++i) add(i < text.size() ? text[i] : '\0');
  }

  std::vector<double>& to_;
};

inline std::vector<double> fields_of(const Message& message) {
  std::vector<double> all;
  std::visit([&](const auto& m) { Wire<std::decay_t<decltype(m)>>::fields(m, FieldList(all)); },
             message);
  return all;
}

}  // namespace harco::mavlink::test
