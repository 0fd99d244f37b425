// NAME SECONDS [FILE...]: damages copies of the target's own inputs and of the files for that much
// processor time. The input at work is in NAME.input, so that one that crashes is kept.
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "fuzz/fuzz.hpp"

int main(int count, char** arguments) {
  const double seconds = count > 1 ? std::atof(arguments[1]) : 60.0;
  std::vector<throng::fuzz::Bytes> good = throng::fuzz::seeds();
  for (int i = 2; i < count; ++i) {
    std::ifstream file(arguments[i], std::ios::binary);
    good.emplace_back(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
  }
  for (const throng::fuzz::Bytes& bytes : good) LLVMFuzzerTestOneInput(bytes.data(), bytes.size());

  const std::string kept = std::filesystem::path(arguments[0]).filename().string() + ".input";
  const std::uint32_t seed = std::random_device{}();
  std::printf("seed %u\n", seed);
  std::mt19937 random(seed);
  const auto busy = [] { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; };
  const double end = busy() + seconds;
  long tried = 0;
  for (; busy() < end; ++tried) {
    throng::fuzz::Bytes bytes = good[random() % good.size()];
    throng::fuzz::mutate(bytes, random);
    {
      std::ofstream file(kept, std::ios::binary);
      file.write(reinterpret_cast<const char*>(bytes.data()),
                 static_cast<std::streamsize>(bytes.size()));
    }
    LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
  }
  std::remove(kept.c_str());
  std::printf("%ld inputs in %.0f s of processor time, none crashed\n", tried, seconds);
  return 0;
}
