// The part that talks to autopilots: a message goes out and comes back.
#include <iostream>

#include <harco/link.hpp>

int main() {
  using namespace harco::mavlink;
  Packer packer;
  packer.sign_with(SigningKey::from_pass_phrase("deck"));
  const Packet packet = packer.pack(LandingTarget{});
  Parser parser;
  std::vector<Received> out;
  parser.feed(packet.bytes.data(), packet.size, out);
  if (out.size() != 1) return 1;
  std::cout << name_of(out[0].message) << "\n";
  const Link link("udpout:127.0.0.1:14550");
  return link.connected() ? 0 : 1;
}
