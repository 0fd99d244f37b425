#include "throng/trajectory/trajectory.hpp"

namespace throng::trajectory {

std::uint64_t hash_id(const std::string& name) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const char c : name) {
    hash ^= static_cast<unsigned char>(c);
    hash *= 0x100000001b3u;
  }
  return hash;
}

}  // namespace throng::trajectory
