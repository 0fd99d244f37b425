#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>
#include <xxhash.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "render/asset/layout.hpp"
#include "support/tiny_character.hpp"
#include "throng/render/asset.hpp"

namespace throng::render {
namespace {

using layout::FileHeader;
using layout::Section;
using layout::SectionEntry;
using ::testing::HasSubstr;

/// A folder of its own for each test, gone afterwards.
class CharacterFileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() /
              ("throng_asset_" + std::to_string(::getpid()) + "_" +
               ::testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
    path_ = (folder_ / "tiny.throng").string();
    character_ = make_character(test::make_tiny_character()).value();
    ASSERT_TRUE(write_character(character_, path_).ok());
    std::ifstream file(path_, std::ios::binary);
    bytes_.assign(std::istreambuf_iterator<char>(file), {});
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  FileHeader header() const {
    FileHeader header;
    std::memcpy(&header, bytes_.data(), sizeof(header));
    return header;
  }
  std::vector<SectionEntry> table() const {
    std::vector<SectionEntry> table(header().section_count);
    std::memcpy(table.data(), bytes_.data() + sizeof(FileHeader),
                table.size() * sizeof(SectionEntry));
    return table;
  }
  SectionEntry entry(Section section) const {
    for (const SectionEntry& each : table()) {
      if (each.kind == static_cast<std::uint32_t>(section)) return each;
    }
    return {};
  }

  /// Makes all checksums right again, so that only the reader's own checks are left.
  static void seal(std::string& bytes) {
    FileHeader header;
    std::memcpy(&header, bytes.data(), sizeof(header));
    char* table_bytes = bytes.data() + sizeof(header);
    for (std::uint32_t i = 0; i < header.section_count; ++i) {
      SectionEntry entry;
      std::memcpy(&entry, table_bytes + i * sizeof(entry), sizeof(entry));
      if (entry.offset <= bytes.size() && entry.size_bytes <= bytes.size() - entry.offset) {
        entry.checksum = XXH3_64bits(bytes.data() + entry.offset, entry.size_bytes);
      }
      std::memcpy(table_bytes + i * sizeof(entry), &entry, sizeof(entry));
    }
    header.table_checksum = XXH3_64bits(table_bytes, header.section_count * sizeof(SectionEntry));
    header.size_bytes = bytes.size();
    std::memcpy(bytes.data(), &header, sizeof(header));
  }

  absl::StatusOr<Character> read(const std::string& bytes) const {
    const std::string path = (folder_ / "changed.throng").string();
    std::ofstream(path, std::ios::binary) << bytes;
    return read_character(path);
  }

  template <typename T>
  static void poke(std::string& bytes, std::size_t offset, const T& value) {
    std::memcpy(bytes.data() + offset, &value, sizeof(value));
  }

  std::filesystem::path folder_;
  std::string path_, bytes_;
  Character character_;
};

template <typename T>
bool same_bytes(std::span<const T> a, std::span<const T> b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size_bytes()) == 0;
}

TEST_F(CharacterFileTest, ReadsBackWhatWasWritten) {
  const auto read = read_character(path_);
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->name, "tiny");
  EXPECT_TRUE(same_bytes(read->position, character_.position));
  EXPECT_TRUE(same_bytes(read->normal, character_.normal));
  EXPECT_TRUE(same_bytes(read->uv, character_.uv));
  EXPECT_TRUE(same_bytes(read->joint_index, character_.joint_index));
  EXPECT_TRUE(same_bytes(read->joint_weight, character_.joint_weight));
  EXPECT_TRUE(same_bytes(read->collapse_target, character_.collapse_target));
  EXPECT_TRUE(same_bytes(read->triangle, character_.triangle));
  EXPECT_TRUE(same_bytes(read->triangle_flags, character_.triangle_flags));
  EXPECT_TRUE(same_bytes(read->triangle_count_at, character_.triangle_count_at));
  EXPECT_TRUE(same_bytes(read->legal_count, character_.legal_count));
  EXPECT_TRUE(same_bytes(read->collapse_error_m, character_.collapse_error_m));
  EXPECT_TRUE(same_bytes(read->palette, character_.palette));
  EXPECT_TRUE(same_bytes(read->base_color.texels, character_.base_color.texels));
  EXPECT_TRUE(same_bytes(read->tint_mask.texels, character_.tint_mask.texels));
  EXPECT_EQ(read->corner_tones.most_vertices(), 20U);
  EXPECT_TRUE(same_bytes(read->corner_tones.band, character_.corner_tones.band));
  EXPECT_TRUE(same_bytes(read->corner_tones.tone, character_.corner_tones.tone));
  EXPECT_EQ(read->coarsest_count, 12U);
  EXPECT_EQ(read->bounds, character_.bounds);
  EXPECT_EQ(read->height_m, character_.height_m);
  ASSERT_EQ(read->joints.size(), 2U);
  EXPECT_EQ(read->joints[1].name, "upper");
  EXPECT_EQ(read->joints[1].parent, 0);
  ASSERT_EQ(read->clips.size(), 2U);
  EXPECT_EQ(read->clips[1].name, "walk");
  EXPECT_EQ(read->clips[1].kind, ClipKind::kWalk);
  EXPECT_EQ(read->clips[1].first_frame, 8U);
  EXPECT_EQ(read->clips[1].stride_m, 1.4F);
  EXPECT_TRUE(read->clips[1].loop);
}

TEST_F(CharacterFileTest, SameCharacterGivesSameBytes) {
  const std::string again = (folder_ / "again.throng").string();
  ASSERT_TRUE(write_character(read_character(path_).value(), again).ok());
  std::ifstream file(again, std::ios::binary);
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(file), {}), bytes_);
}

TEST_F(CharacterFileTest, SectionsAreAligned) {
  for (const SectionEntry& each : table()) EXPECT_EQ(each.offset % 64, 0U);
}

TEST_F(CharacterFileTest, CharacterOutlivesTheFile) {
  const auto read = read_character(path_);
  ASSERT_TRUE(read.ok());
  const Character copy = *read;
  std::filesystem::remove(path_);
  EXPECT_TRUE(validate(copy).ok());
}

TEST_F(CharacterFileTest, MissingFileIsNotFound) {
  EXPECT_EQ(read_character((folder_ / "none.throng").string()).status().code(),
            absl::StatusCode::kNotFound);
}

TEST_F(CharacterFileTest, FolderIsRefused) {
  EXPECT_EQ(read_character(folder_.string()).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(CharacterFileTest, UnwritableFolderIsUnavailableAndLeavesNothing) {
  const auto status = write_character(character_, (folder_ / "none" / "x.throng").string());
  EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(status.message()), HasSubstr("open"));
}

TEST_F(CharacterFileTest, WritingLeavesNoTemporaryFile) {
  int files = 0;
  for ([[maybe_unused]] const auto& each : std::filesystem::directory_iterator(folder_)) ++files;
  EXPECT_EQ(files, 1);
}

TEST_F(CharacterFileTest, BrokenCharacterIsNotWritten) {
  Character broken = character_;
  broken.coarsest_count = 0;
  const std::string path = (folder_ / "broken.throng").string();
  EXPECT_EQ(write_character(broken, path).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_FALSE(std::filesystem::exists(path));
}

TEST_F(CharacterFileTest, TruncationAtEveryBorderIsRefused) {
  std::vector<std::size_t> sizes = {0, 1, 63, 64, 65};
  for (const SectionEntry& each : table()) {
    for (const std::uint64_t border : {each.offset, each.offset + each.size_bytes}) {
      for (const std::uint64_t size : {border - 1, border, border + 1}) {
        if (size < bytes_.size()) sizes.push_back(size);
      }
    }
  }
  for (const std::size_t size : sizes) {
    const auto result = read(bytes_.substr(0, size));
    EXPECT_EQ(result.status().code(), absl::StatusCode::kInvalidArgument) << "at " << size;
    if (size < 64) continue;
    // the same with a header that agrees with the shorter file
    std::string sealed = bytes_.substr(0, size);
    const std::uint64_t claimed = size;
    poke(sealed, offsetof(FileHeader, size_bytes), claimed);
    EXPECT_EQ(read(sealed).status().code(), absl::StatusCode::kInvalidArgument)
        << "sealed at " << size;
  }
}

TEST_F(CharacterFileTest, TrailingBytesAreRefused) {
  EXPECT_THAT(std::string(read(bytes_ + "x").status().message()), HasSubstr("must have"));
}

TEST_F(CharacterFileTest, EveryFlippedBitInASectionIsNoticed) {
  for (const SectionEntry& each : table()) {
    for (const std::uint64_t at :
         {each.offset, each.offset + each.size_bytes / 2, each.offset + each.size_bytes - 1}) {
      std::string flipped = bytes_;
      flipped[at] = static_cast<char>(flipped[at] ^ 0x10);
      EXPECT_THAT(std::string(read(flipped).status().message()), HasSubstr("checksum"))
          << "byte " << at;
    }
  }
}

TEST_F(CharacterFileTest, AnyFlippedByteOfHeaderOrTableIsSafe) {
  const std::size_t end = sizeof(FileHeader) + header().section_count * sizeof(SectionEntry);
  for (std::size_t at = 0; at < end; ++at) {
    std::string flipped = bytes_;
    flipped[at] = static_cast<char>(flipped[at] ^ 0xFF);
    const auto result = read(flipped);
    const bool is_unused = at >= offsetof(FileHeader, reserved) && at < sizeof(FileHeader);
    const bool is_minor =
        at >= offsetof(FileHeader, minor) && at < offsetof(FileHeader, section_count);
    EXPECT_EQ(result.ok(), is_unused || is_minor) << "byte " << at;
  }
}

TEST_F(CharacterFileTest, AnyFlippedByteWithRightChecksumsIsSafe) {
  // whatever comes back either failed with a message or passed every check
  for (std::size_t at = sizeof(FileHeader); at < bytes_.size(); at += 3) {
    std::string flipped = bytes_;
    flipped[at] = static_cast<char>(flipped[at] ^ 0xFF);
    seal(flipped);
    const auto result = read(flipped);
    if (result.ok()) {
      EXPECT_TRUE(validate(*result).ok());
    } else {
      EXPECT_FALSE(result.status().message().empty());
    }
  }
}

TEST_F(CharacterFileTest, UnknownMajorVersionIsRefused) {
  poke(bytes_, offsetof(FileHeader, major), std::uint16_t{2});
  const auto result = read(bytes_);
  EXPECT_EQ(result.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(result.status().message()), HasSubstr("format version is 2.0"));
}

TEST_F(CharacterFileTest, NewerMinorVersionIsRead) {
  poke(bytes_, offsetof(FileHeader, minor), std::uint16_t{7});
  EXPECT_TRUE(read(bytes_).ok());
}

TEST_F(CharacterFileTest, UnknownSectionIsSkipped) {
  // the mask becomes a section of a kind that nobody knows yet
  std::string bytes = bytes_;
  auto entries = table();
  for (std::size_t i = 0; i < entries.size(); ++i) {
    if (entries[i].kind != static_cast<std::uint32_t>(Section::kTintMask)) continue;
    entries[i].kind = 4711;
    poke(bytes, sizeof(FileHeader) + i * sizeof(SectionEntry), entries[i]);
  }
  const std::size_t info = entry(Section::kInfo).offset;
  poke(bytes, info + offsetof(layout::Info, tint_mask_width_px), std::uint32_t{0});
  poke(bytes, info + offsetof(layout::Info, tint_mask_height_px), std::uint32_t{0});
  poke(bytes, info + offsetof(layout::Info, tint_mask_levels), std::uint32_t{0});
  seal(bytes);
  const auto result = read(bytes);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_TRUE(result->tint_mask.texels.empty());
}

TEST_F(CharacterFileTest, MissingSectionIsNamed) {
  std::string bytes = bytes_;
  auto entries = table();
  for (std::size_t i = 0; i < entries.size(); ++i) {
    if (entries[i].kind != static_cast<std::uint32_t>(Section::kUv)) continue;
    entries[i].kind = 4711;
    poke(bytes, sizeof(FileHeader) + i * sizeof(SectionEntry), entries[i]);
  }
  seal(bytes);
  EXPECT_THAT(std::string(read(bytes).status().message()), HasSubstr("uv: section is missing"));
}

TEST_F(CharacterFileTest, SectionTwiceIsRefused) {
  std::string bytes = bytes_;
  auto entries = table();
  entries[3].kind = entries[2].kind;
  poke(bytes, sizeof(FileHeader) + 3 * sizeof(SectionEntry), entries[3]);
  seal(bytes);
  EXPECT_THAT(std::string(read(bytes).status().message()), HasSubstr("appears twice"));
}

TEST_F(CharacterFileTest, HostileCountsAreRefused) {
  const std::size_t info = entry(Section::kInfo).offset;
  const std::size_t fields[] = {
      offsetof(layout::Info, vertex_count),        offsetof(layout::Info, triangle_count),
      offsetof(layout::Info, joint_count),         offsetof(layout::Info, clip_count),
      offsetof(layout::Info, frame_count),         offsetof(layout::Info, coarsest_count),
      offsetof(layout::Info, base_color_width_px), offsetof(layout::Info, base_color_height_px),
      offsetof(layout::Info, base_color_levels),   offsetof(layout::Info, tint_mask_levels)};
  for (const std::size_t field : fields) {
    for (const std::uint32_t count : {0U, 0x7FFFFFFFU, 0x80000000U, 0xFFFFFFFFU, 0x55555556U}) {
      std::string bytes = bytes_;
      poke(bytes, info + field, count);
      seal(bytes);
      EXPECT_EQ(read(bytes).status().code(), absl::StatusCode::kInvalidArgument)
          << "field " << field << " count " << count;
    }
  }
}

TEST_F(CharacterFileTest, HostileOffsetsAreRefused) {
  for (const std::uint64_t offset :
       {~std::uint64_t{0} - 63, std::uint64_t{1} << 63, std::uint64_t{bytes_.size() + 64}}) {
    std::string bytes = bytes_;
    auto entries = table();
    entries[2].offset = offset / 64 * 64;
    poke(bytes, sizeof(FileHeader) + 2 * sizeof(SectionEntry), entries[2]);
    seal(bytes);
    EXPECT_THAT(std::string(read(bytes).status().message()), HasSubstr("end after the file"));
  }
}

TEST_F(CharacterFileTest, HostileToneCountsAreRefused) {
  const std::size_t header = entry(Section::kCornerTone).offset;
  for (const std::size_t field : {offsetof(layout::CornerToneHeader, band_count),
                                  offsetof(layout::CornerToneHeader, triangle_count)}) {
    for (const std::uint32_t count : {0U, 1U, 3U, 0x7FFFFFFFU, 0x80000000U, 0xFFFFFFFFU}) {
      std::string bytes = bytes_;
      poke(bytes, header + field, count);
      seal(bytes);
      EXPECT_EQ(read(bytes).status().code(), absl::StatusCode::kInvalidArgument) << count;
    }
  }
}

TEST_F(CharacterFileTest, UnknownVersionOfTonesIsRefused) {
  poke(bytes_, entry(Section::kCornerTone).offset, std::uint32_t{2});
  seal(bytes_);
  const auto status = read(bytes_).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(std::string(status.message()), HasSubstr("corner tone: version is 2"));
}

TEST_F(CharacterFileTest, HostileNameReferenceIsRefused) {
  const std::size_t joint = entry(Section::kJoint).offset;
  poke(bytes_, joint, layout::StringRef{0xFFFFFFF0U, 0x20});
  seal(bytes_);
  EXPECT_THAT(std::string(read(bytes_).status().message()), HasSubstr("strings"));
}

TEST_F(CharacterFileTest, IndexOutOfRangeIsNamed) {
  poke(bytes_, entry(Section::kTriangle).offset + 4, std::uint32_t{38});
  seal(bytes_);
  const std::string message(read(bytes_).status().message());
  EXPECT_THAT(message, HasSubstr("changed.throng: triangle 0 has corner 38, must be below 38"));
}

TEST_F(CharacterFileTest, NanIsNamed) {
  poke(bytes_, entry(Section::kPosition).offset + 24, std::uint32_t{0x7FC00000U});
  seal(bytes_);
  EXPECT_THAT(std::string(read(bytes_).status().message()), HasSubstr("position 2 is (nan"));
}

}  // namespace
}  // namespace throng::render
