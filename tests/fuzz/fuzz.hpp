#pragma once

#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

/// A fuzz target: one function that libFuzzer, or driver.cpp where there is none, feeds.
/// Refused or sound, anything else ends the program.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace throng::fuzz {

using Bytes = std::vector<std::uint8_t>;

/// Good inputs to begin with.
std::vector<Bytes> seeds();

/// Damages a few bytes, in places where much is decided.
void mutate(Bytes& bytes, std::mt19937& random);

}  // namespace throng::fuzz
