// Sends random messages of every kind over a link, prints each as a line of JSON, and expects every
// one of them back, unchanged. Usage: mavlink_peer LINK [PASS_PHRASE]. See node/referee.mjs.
#include <cstdio>
#include <random>

#include "harco/link.hpp"
#include "sample_messages.hpp"

namespace {

using namespace harco::mavlink;  // NOLINT(google-build-using-namespace): a program of one page

void print(const Message& message) {
  std::printf("{\"name\": \"%s\", \"fields\": [", name_of(message));
  const char* comma = "";
  for (const double value : test::fields_of(message)) {
    std::printf("%s%.17g", comma, value);
    comma = ", ";
  }
  std::printf("]}\n");
}

}  // namespace

int main(int argc, char** argv) {
  LinkOptions options;
  options.from = {7, 42};
  if (argc > 2) options.key = SigningKey::from_pass_phrase(argv[2]);
  Link link(argv[1], options);
  std::mt19937 random(5);
  std::vector<Received> back;
  for (int round = 0; round < 20; ++round)
    for (const Message& message : test::random_messages(random)) {
      print(message);
      if (!link.send(message)) return 1;
      back.clear();
      for (int i = 0; back.empty() && i < 200; ++i)
        link.wait(std::chrono::milliseconds(50), -1, back);
      if (back.size() != 1 || !(back[0].from == Address{9, 1}) ||
          test::fields_of(back[0].message) != test::fields_of(message)) {
        std::fprintf(stderr, "mavlink_peer: %s didn't come back as it went\n", name_of(message));
        return 1;
      }
    }
  return 0;
}
