#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <random>

#include "simplify/import/gltf.hpp"
#include "simplify/import/made_up.hpp"

/// One input of a fuzzer: refused or sound, anything else ends the program.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto character = throng::simplify::import_gltf_bytes({data, size}, "fuzz.gltf");
  if (!character.ok()) return 0;
  const std::string fault = throng::simplify::test::fault_of(*character);
  if (fault.empty()) return 0;
  std::fprintf(stderr, "accepted a character that is not sound: %s\n", fault.c_str());
  std::abort();
}

#ifndef THRONG_LIBFUZZER
/// import_fuzz SECONDS [FILE...]: damages copies of the files, or of a made-up one, for that long.
/// An input that crashes is left in import_fuzz.input.
int main(int count, char** arguments) {
  using Clock = std::chrono::steady_clock;
  namespace test = throng::simplify::test;
  const double seconds = count > 1 ? std::atof(arguments[1]) : 60.0;
  std::vector<std::vector<std::uint8_t>> good;
  for (int i = 2; i < count; ++i) good.push_back(test::read_bytes(arguments[i]));
  if (good.empty()) good.push_back(test::rich_file().glb());
  std::mt19937 random(std::random_device{}());
  const Clock::time_point end =
      Clock::now() + std::chrono::milliseconds(static_cast<long>(seconds * 1000.0));
  long tried = 0;
  while (Clock::now() < end) {
    std::vector<std::uint8_t> bytes = good[random() % good.size()];
    if (bytes.size() < 32) continue;
    const bool is_glb = bytes[0] == 'g';
    const std::size_t json_end =
        is_glb ? std::min(test::json_end_of(bytes), bytes.size() - 1) : bytes.size() - 1;
    test::mutate(bytes, is_glb ? 20 : 0, json_end, random);
    test::write_file("import_fuzz.input", bytes);
    LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
    ++tried;
  }
  std::remove("import_fuzz.input");
  std::printf("%ld inputs, none crashed\n", tried);
  return 0;
}
#endif
