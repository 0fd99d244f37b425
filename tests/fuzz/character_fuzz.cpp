#include <sys/mman.h>
#include <unistd.h>
#include <xxhash.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "fuzz/fuzz.hpp"
#include "render/asset/layout.hpp"
#include "render/raster/element/tone.hpp"
#include "support/tiny_character.hpp"

namespace layout = throng::render::layout;

namespace {

/// Reads all that a renderer reads, in the plainest way.
void use(const throng::render::Character& character) {
  double sum = 0.0;
  for (std::uint32_t n = character.coarsest_count; n <= character.vertex_count(); ++n) {
    for (std::uint32_t k = 0; k < character.triangle_count_at[n]; ++k) {
      glm::uvec3 corner = character.triangle[k];
      for (int i = 0; i < 3; ++i) {
        while (corner[i] >= n) corner[i] = character.collapse_target[corner[i]];
        sum += character.position[corner[i]].x;
      }
      sum += character.triangle_flags[k];
    }
    sum += character.legal_count[n];
  }
  for (std::uint32_t i = 0; i < character.vertex_count(); ++i) {
    sum += throng::render::decode_octahedral(character.normal[i]).x + character.uv[i].x;
    for (int k = 0; k < 4; ++k) {
      if (character.joint_weight[i][k] == 0) continue;
      for (const throng::render::Clip& clip : character.clips) {
        const std::uint32_t frame = clip.first_frame + clip.frame_count - 1;
        sum +=
            character
                .palette[std::size_t{frame} * character.joint_count() + character.joint_index[i][k]]
                .row[0]
                .x;
      }
    }
  }
  const throng::render::CornerTones& tones = character.corner_tones;
  for (std::uint32_t n = character.coarsest_count; n <= tones.most_vertices(); ++n) {
    const std::uint32_t first = throng::render::element::first_tone(
        tones.band.data(), static_cast<std::uint32_t>(tones.band.size()), n);
    for (std::uint32_t k = 0; k < 3 * character.triangle_count_at[n]; ++k)
      sum += tones.tone[first + k];
  }
  for (const std::uint8_t texel : character.base_color.texels) sum += texel;
  for (const std::uint8_t texel : character.tint_mask.texels) sum += texel;
  if (std::isfinite(sum)) return;
  std::fprintf(stderr, "accepted a character with numbers that are not finite\n");
  std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const int file = ::memfd_create("character", 0);
  if (file < 0 || ::write(file, data, size) != static_cast<ssize_t>(size)) std::abort();
  const auto character = throng::render::read_character("/proc/self/fd/" + std::to_string(file));
  ::close(file);
  if (character.ok()) use(*character);
  return 0;
}

namespace throng::fuzz {

std::vector<Bytes> seeds() {
  const std::string path = (std::filesystem::temp_directory_path() /
                            ("character_fuzz_" + std::to_string(::getpid()) + ".throng"))
                               .string();
  if (!render::write_character(*render::make_character(test::make_tiny_character()), path).ok())
    std::abort();
  std::ifstream file(path, std::ios::binary);
  Bytes bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  std::filesystem::remove(path);
  return {bytes};
}

/// Most changes would end at a checksum, so those are put right again, nearly always.
void mutate(Bytes& bytes, std::mt19937& random) {
  layout::FileHeader header;
  if (bytes.size() < sizeof(header)) return;
  std::memcpy(&header, bytes.data(), sizeof(header));
  const std::size_t room = (bytes.size() - sizeof(header)) / sizeof(layout::SectionEntry);
  std::vector<layout::SectionEntry> table(std::min<std::size_t>(header.section_count, room));
  if (table.empty()) return;
  std::memcpy(table.data(), &bytes[sizeof(header)], table.size() * sizeof(table[0]));

  const auto damage = [&](std::size_t at) {
    switch (random() % 4) {
      case 0:
        bytes[at] = static_cast<std::uint8_t>(random());
        break;
      case 1:
        bytes[at] ^= static_cast<std::uint8_t>(1U << random() % 8);
        break;
      case 2:
        bytes[at] = random() % 2 == 0 ? 0xFF : 0x7F;
        break;
      default:
        bytes[at] = static_cast<std::uint8_t>(bytes[at] + 1);
    }
  };
  const std::size_t changes = 1 + random() % 4;
  for (std::size_t i = 0; i < changes; ++i) {
    const layout::SectionEntry& entry = table[random() % table.size()];
    if (random() % 12 == 0) {
      damage(random() % (sizeof(header) + table.size() * sizeof(table[0])));
    } else if (entry.size_bytes > 0 && entry.offset + entry.size_bytes <= bytes.size()) {
      damage(entry.offset + random() % entry.size_bytes);
    }
  }
  if (random() % 16 == 0) return;
  std::memcpy(table.data(), &bytes[sizeof(header)], table.size() * sizeof(table[0]));
  for (layout::SectionEntry& entry : table) {
    if (entry.offset > bytes.size() || entry.size_bytes > bytes.size() - entry.offset) continue;
    entry.checksum = XXH3_64bits(&bytes[entry.offset], entry.size_bytes);
  }
  std::memcpy(&bytes[sizeof(header)], table.data(), table.size() * sizeof(table[0]));
  header.table_checksum = XXH3_64bits(&bytes[sizeof(header)], table.size() * sizeof(table[0]));
  std::memcpy(&bytes[offsetof(layout::FileHeader, table_checksum)], &header.table_checksum,
              sizeof(header.table_checksum));
}

}  // namespace throng::fuzz
