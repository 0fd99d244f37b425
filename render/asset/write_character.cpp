#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <unistd.h>
#include <xxhash.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <utility>

#include "render/asset/layout.hpp"
#include "throng/render/asset.hpp"
#include "throng/render/relief.hpp"

namespace throng::render {
namespace {

using layout::Section;

struct Column {
  Section section;
  const void* bytes;
  std::uint64_t size_bytes;
};

template <typename T>
Column column(Section section, std::span<const T> values) {
  return {section, values.data(), values.size_bytes()};
}

/// Names share one section; a reference is an offset and a size in it.
class StringTable {
 public:
  layout::StringRef add(const std::string& text) {
    const layout::StringRef ref{static_cast<std::uint32_t>(bytes_.size()),
                                static_cast<std::uint32_t>(text.size())};
    bytes_ += text;
    return ref;
  }
  std::span<const char> bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

std::uint64_t aligned(std::uint64_t offset) {
  return (offset + layout::kAlignment - 1) / layout::kAlignment * layout::kAlignment;
}

absl::Status write_error(const std::string& path, const char* call) {
  return absl::UnavailableError(absl::StrCat(path, ": ", call, ": ", std::strerror(errno)));
}

absl::Status write_all(int file, const void* bytes, std::uint64_t size_bytes,
                       const std::string& path) {
  const char* next = static_cast<const char*>(bytes);
  while (size_bytes > 0) {
    const ssize_t written = ::write(file, next, size_bytes);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return write_error(path, "write");
    next += written;
    size_bytes -= static_cast<std::uint64_t>(written);
  }
  return absl::OkStatus();
}

absl::Status write_file(int file, const layout::FileHeader& header,
                        const std::vector<layout::SectionEntry>& table,
                        const std::vector<Column>& columns, const std::string& path) {
  if (auto status = write_all(file, &header, sizeof(header), path); !status.ok()) return status;
  if (auto status = write_all(file, table.data(), table.size() * sizeof(table[0]), path);
      !status.ok()) {
    return status;
  }
  std::uint64_t at = sizeof(header) + table.size() * sizeof(table[0]);
  static constexpr char kZeros[layout::kAlignment] = {};
  for (std::size_t i = 0; i < columns.size(); ++i) {
    if (auto status = write_all(file, kZeros, table[i].offset - at, path); !status.ok())
      return status;
    if (auto status = write_all(file, columns[i].bytes, columns[i].size_bytes, path);
        !status.ok()) {
      return status;
    }
    at = table[i].offset + table[i].size_bytes;
  }
  if (::fsync(file) != 0) return write_error(path, "fsync");
  return absl::OkStatus();
}

}  // namespace

absl::Status write_character(const Character& character, const std::string& path) {
  if (auto status = validate(character); !status.ok()) {
    return absl::Status(status.code(), absl::StrCat(path, ": ", status.message()));
  }

  StringTable strings;
  layout::Info info{};
  info.name = strings.add(character.name);
  info.vertex_count = character.vertex_count();
  info.triangle_count = character.triangle_count();
  info.joint_count = character.joint_count();
  info.clip_count = static_cast<std::uint32_t>(character.clips.size());
  info.frame_count = static_cast<std::uint32_t>(character.palette.size() / character.joints.size());
  info.coarsest_count = character.coarsest_count;
  info.base_color_width_px = character.base_color.width_px;
  info.base_color_height_px = character.base_color.height_px;
  info.base_color_levels = character.base_color.level_count;
  info.tint_mask_width_px = character.tint_mask.width_px;
  info.tint_mask_height_px = character.tint_mask.height_px;
  info.tint_mask_levels = character.tint_mask.level_count;
  for (int i = 0; i < 4; ++i) info.bounds[i] = character.bounds[i];
  for (int i = 0; i < 4; ++i) info.gait_bounds[i] = character.gait_bounds[i];
  info.height_m = character.height_m;
  info.point_count = character.points.count();

  std::vector<layout::JointRecord> joints;
  for (const Joint& joint : character.joints) {
    joints.push_back({strings.add(joint.name), joint.parent, 0, joint.joint_from_model});
  }
  std::vector<layout::ClipRecord> clips;
  for (const Clip& clip : character.clips) {
    clips.push_back({strings.add(clip.name),
                     static_cast<std::uint32_t>(clip.kind),
                     clip.first_frame,
                     clip.frame_count,
                     clip.rate_hz,
                     clip.loop ? 1U : 0U,
                     clip.stride_m,
                     clip.speed_mps,
                     {}});
  }

  std::vector<Column> columns = {
      {Section::kInfo, &info, sizeof(info)},
      column(Section::kStrings, strings.bytes()),
      column(Section::kPosition, character.position),
      column(Section::kNormal, character.normal),
      column(Section::kUv, character.uv),
      column(Section::kJointIndex, character.joint_index),
      column(Section::kJointWeight, character.joint_weight),
      column(Section::kCollapseTarget, character.collapse_target),
      column(Section::kTriangle, character.triangle),
      column(Section::kTriangleFlags, character.triangle_flags),
      column(Section::kTriangleCountAt, character.triangle_count_at),
      column(Section::kLegalCount, character.legal_count),
      column(Section::kCollapseError, character.collapse_error_m),
      column<layout::JointRecord>(Section::kJoint, joints),
      column<layout::ClipRecord>(Section::kClip, clips),
      column(Section::kPalette, character.palette),
      column(Section::kBaseColor, character.base_color.texels),
  };
  if (!character.tint_mask.texels.empty()) {
    columns.push_back(column(Section::kTintMask, character.tint_mask.texels));
  }
  std::vector<char> impostor;
  if (character.relief != nullptr) {
    const Relief& relief = *character.relief;
    const layout::ReliefHeader relief_header{static_cast<std::uint32_t>(relief.boxes.size()),
                                             static_cast<std::uint32_t>(relief.shape.size()),
                                             relief.capture_frame,
                                             relief.texel_m,
                                             {}};
    const auto append = [&impostor](const void* bytes, std::size_t size_bytes) {
      const char* first = static_cast<const char*>(bytes);
      impostor.insert(impostor.end(), first, first + size_bytes);
    };
    append(&relief_header, sizeof(relief_header));
    append(relief.boxes.data(), relief.boxes.size_bytes());
    append(relief.shape.data(), relief.shape.size_bytes());
    append(relief.color.data(), relief.color.size_bytes());
    append(relief.tint.data(), relief.tint.size_bytes());
    columns.push_back(column<char>(Section::kImpostor, impostor));
  }

  if (character.points.count() > 0) {
    columns.push_back(column(Section::kPoint, character.points.point));
    columns.push_back(column(Section::kPointRadius, character.points.radius_m));
    columns.push_back(column(Section::kPointTone, character.points.tone));
  }
  std::vector<char> corner_tone;
  if (const CornerTones& tones = character.corner_tones; !tones.band.empty()) {
    const layout::CornerToneHeader tone_header{layout::kCornerToneVersion,
                                               static_cast<std::uint32_t>(tones.band.size()),
                                               static_cast<std::uint32_t>(tones.tone.size() / 3),
                                               {}};
    const auto append = [&corner_tone](const void* bytes, std::size_t size_bytes) {
      const char* first = static_cast<const char*>(bytes);
      corner_tone.insert(corner_tone.end(), first, first + size_bytes);
    };
    append(&tone_header, sizeof(tone_header));
    append(tones.band.data(), tones.band.size_bytes());
    append(tones.tone.data(), tones.tone.size_bytes());
    columns.push_back(column<char>(Section::kCornerTone, corner_tone));
  }

  std::vector<layout::SectionEntry> table;
  std::uint64_t at = sizeof(layout::FileHeader) + columns.size() * sizeof(layout::SectionEntry);
  for (const Column& each : columns) {
    at = aligned(at);
    table.push_back({static_cast<std::uint32_t>(each.section), 0, at, each.size_bytes,
                     XXH3_64bits(each.bytes, each.size_bytes)});
    at += each.size_bytes;
  }
  layout::FileHeader header{};
  header.magic = layout::kMagic;
  header.major = layout::kMajor;
  header.minor = layout::kMinor;
  header.section_count = static_cast<std::uint32_t>(table.size());
  header.size_bytes = at;
  header.table_checksum = XXH3_64bits(table.data(), table.size() * sizeof(table[0]));

  // A reader sees the old file or the whole new one, never a part.
  const std::string temporary = absl::StrCat(path, ".tmp", ::getpid());
  const int file = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (file < 0) return write_error(temporary, "open");
  absl::Status status = write_file(file, header, table, columns, temporary);
  if (::close(file) != 0 && status.ok()) status = write_error(temporary, "close");
  if (status.ok() && std::rename(temporary.c_str(), path.c_str()) != 0)
    status = write_error(path, "rename");
  if (!status.ok()) ::unlink(temporary.c_str());
  return status;
}

}  // namespace throng::render
