#include <cstdio>
#include <cstdlib>
#include <string>

#include "fuzz/fuzz.hpp"
#include "simplify/import/gltf.hpp"
#include "simplify/import/made_up.hpp"

namespace test = throng::simplify::test;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto character = throng::simplify::import_gltf_bytes({data, size}, "fuzz.gltf");
  if (!character.ok()) return 0;
  const std::string fault = test::fault_of(*character);
  if (fault.empty()) return 0;
  std::fprintf(stderr, "accepted a character that is not sound: %s\n", fault.c_str());
  std::abort();
}

namespace throng::fuzz {

std::vector<Bytes> seeds() { return {test::rich_file().glb(), test::bending_post().glb()}; }

void mutate(Bytes& bytes, std::mt19937& random) {
  if (bytes.size() < 32) return;
  const bool is_glb = bytes[0] == 'g';
  const std::size_t json_end =
      is_glb ? std::min(test::json_end_of(bytes), bytes.size() - 1) : bytes.size() - 1;
  test::mutate(bytes, is_glb ? 20 : 0, json_end, random);
  if (random() % 16 == 0) bytes.resize(random() % bytes.size());
}

}  // namespace throng::fuzz
