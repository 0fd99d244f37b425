#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include <cerrno>
#include <cstring>
#include <memory>

#include "render/asset/layout.hpp"
#include "throng/render/asset.hpp"
#include "throng/render/relief.hpp"

namespace throng::render {
namespace {

using layout::Section;

/// A file mapped read-only; unmapped when the last character that looks into it goes.
class MappedFile {
 public:
  MappedFile(void* bytes, std::size_t size_bytes) : bytes_(bytes), size_bytes_(size_bytes) {}
  ~MappedFile() { ::munmap(bytes_, size_bytes_); }
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;

  const std::byte* data() const { return static_cast<const std::byte*>(bytes_); }
  std::size_t size() const { return size_bytes_; }

 private:
  void* bytes_;
  std::size_t size_bytes_;
};

absl::StatusOr<std::shared_ptr<const MappedFile>> map_file(const std::string& path) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return absl::NotFoundError(absl::StrCat(path, ": open: ", std::strerror(errno)));
  struct stat info {};
  if (::fstat(file, &info) != 0 || !S_ISREG(info.st_mode)) {
    ::close(file);
    return absl::InvalidArgumentError(absl::StrCat(path, ": is not a regular file"));
  }
  const auto size_bytes = static_cast<std::size_t>(info.st_size);
  if (size_bytes < sizeof(layout::FileHeader)) {
    ::close(file);
    return absl::InvalidArgumentError(absl::StrCat(path, ": header: file has ", size_bytes,
                                                   " bytes, must have at least ",
                                                   sizeof(layout::FileHeader)));
  }
  void* bytes = ::mmap(nullptr, size_bytes, PROT_READ, MAP_PRIVATE, file, 0);
  const int map_errno = errno;
  ::close(file);
  if (bytes == MAP_FAILED) {
    return absl::ResourceExhaustedError(absl::StrCat(path, ": mmap: ", std::strerror(map_errno)));
  }
  return std::make_shared<const MappedFile>(bytes, size_bytes);
}

/// Looks sections up in a file whose bytes are not trusted. Messages don't name the file.
class SectionReader {
 public:
  explicit SectionReader(std::span<const std::byte> file) : file_(file) {}

  /// Checks the header, the table, and range and checksum of every section, known or not.
  absl::Status check() {
    layout::FileHeader header;
    std::memcpy(&header, file_.data(), sizeof(header));
    if (header.magic != layout::kMagic)
      return bad("header: magic is wrong, this is no baked character");
    if (header.major != layout::kMajor) {
      return absl::FailedPreconditionError(
          absl::StrCat("header: format version is ", header.major, ".", header.minor,
                       ", this program reads ", layout::kMajor, ".x; bake the character again"));
    }
    if (header.size_bytes != file_.size()) {
      return bad("header: file has ", file_.size(), " bytes, must have ", header.size_bytes);
    }
    const std::uint64_t count = header.section_count;
    if (count > layout::kMaxSections ||
        sizeof(header) + count * sizeof(layout::SectionEntry) > file_.size()) {
      return bad("header: section count is ", count, ", limit is ", layout::kMaxSections,
                 " and the file's size");
    }
    table_.resize(count);
    const std::byte* table_bytes = file_.data() + sizeof(header);
    const std::uint64_t table_size = count * sizeof(layout::SectionEntry);
    if (table_size > 0) std::memcpy(table_.data(), table_bytes, table_size);
    if (XXH3_64bits(table_bytes, table_size) != header.table_checksum) {
      return bad("section table: checksum is wrong, the file is damaged");
    }
    for (const layout::SectionEntry& entry : table_) {
      const std::string name = label(entry);
      if (entry.offset % layout::kAlignment != 0) {
        return bad(name, ": offset is ", entry.offset, ", must be a multiple of ",
                   layout::kAlignment);
      }
      if (entry.offset > file_.size() || entry.size_bytes > file_.size() - entry.offset) {
        return bad(name, ": bytes ", entry.offset, " + ", entry.size_bytes,
                   " end after the file's ", file_.size());
      }
      if (XXH3_64bits(file_.data() + entry.offset, entry.size_bytes) != entry.checksum) {
        return bad(name, ": checksum is wrong, the file is damaged");
      }
      for (const layout::SectionEntry& other : table_) {
        if (&other == &entry) break;
        if (other.kind == entry.kind) return bad(name, ": appears twice");
      }
    }
    return absl::OkStatus();
  }

  /// A section as `count` elements. The first problem is kept in `status()`.
  template <typename T>
  std::span<const T> get(Section section, std::uint64_t count) {
    static_assert(alignof(T) <= layout::kAlignment);
    if (!status_.ok()) return {};
    const layout::SectionEntry* entry = find(section);
    if (entry == nullptr) {
      status_ = bad(layout::name_of(section), ": section is missing");
      return {};
    }
    // divided, not multiplied: a hostile count must not wrap around
    if (entry->size_bytes % sizeof(T) != 0 || entry->size_bytes / sizeof(T) != count) {
      status_ = bad(layout::name_of(section), ": has ", entry->size_bytes, " bytes, must have ",
                    count, " x ", sizeof(T));
      return {};
    }
    return {reinterpret_cast<const T*>(file_.data() + entry->offset), count};
  }

  std::span<const std::byte> bytes(Section section) const {
    const layout::SectionEntry* entry = find(section);
    if (entry == nullptr) return {};
    return file_.subspan(entry->offset, entry->size_bytes);
  }

  std::string text(const layout::StringRef& ref) {
    const std::span<const std::byte> strings = bytes(Section::kStrings);
    if (ref.size > layout::kMaxNameSize || ref.offset > strings.size() ||
        ref.size > strings.size() - ref.offset) {
      if (status_.ok()) {
        status_ =
            bad("strings: name at ", ref.offset, " + ", ref.size, " ends after the section's ",
                strings.size(), " bytes or is over ", layout::kMaxNameSize);
      }
      return {};
    }
    return {reinterpret_cast<const char*>(strings.data()) + ref.offset, ref.size};
  }

  const absl::Status& status() const { return status_; }

 private:
  template <typename... Parts>
  static absl::Status bad(const Parts&... parts) {
    return absl::InvalidArgumentError(absl::StrCat(parts...));
  }

  static std::string label(const layout::SectionEntry& entry) {
    return absl::StrCat(layout::name_of(static_cast<Section>(entry.kind)), " (section ", entry.kind,
                        ")");
  }

  const layout::SectionEntry* find(Section section) const {
    for (const layout::SectionEntry& entry : table_) {
      if (entry.kind == static_cast<std::uint32_t>(section)) return &entry;
    }
    return nullptr;
  }

  std::span<const std::byte> file_;
  std::vector<layout::SectionEntry> table_;
  absl::Status status_;
};

MipImage read_image(SectionReader& sections, Section section, std::uint32_t width_px,
                    std::uint32_t height_px, std::uint32_t levels) {
  MipImage image{width_px, height_px, levels, {}};
  // validate() names a wrong size; here the limit only keeps the products small
  if (width_px > layout::kMaxImageSize_px || height_px > layout::kMaxImageSize_px || levels > 32)
    return image;
  image.texels =
      sections.get<std::uint8_t>(section, 4 * layout::texel_count(width_px, height_px, levels));
  return image;
}

/// The impostor, or null where there is none. `storage` is set by who maps the file.
absl::StatusOr<std::shared_ptr<Relief>> read_relief(std::span<const std::byte> bytes) {
  if (bytes.empty()) return std::shared_ptr<Relief>();
  layout::ReliefHeader header{};
  if (bytes.size() < sizeof(header)) {
    return absl::InvalidArgumentError(absl::StrCat("impostor: has ", bytes.size(),
                                                   " bytes, must have at least ", sizeof(header)));
  }
  std::memcpy(&header, bytes.data(), sizeof(header));
  const std::uint64_t boxes = header.box_count, texels = header.texel_count;
  const std::uint64_t size = sizeof(header) + boxes * sizeof(ReliefBox) + 12 * texels;
  if (boxes > layout::kMaxReliefBoxes || texels > layout::kMaxReliefTexels ||
      size != bytes.size()) {
    return absl::InvalidArgumentError(
        absl::StrCat("impostor: has ", bytes.size(), " bytes, ", boxes, " boxes and ", texels,
                     " texels; limits are ", layout::kMaxReliefBoxes, " boxes, ",
                     layout::kMaxReliefTexels, " texels and these need ", size, " bytes"));
  }
  auto relief = std::make_shared<Relief>();
  relief->capture_frame = header.capture_frame;
  relief->texel_m = header.texel_m;
  const std::byte* next = bytes.data() + sizeof(header);
  relief->boxes = {reinterpret_cast<const ReliefBox*>(next), boxes};
  next += boxes * sizeof(ReliefBox);
  for (auto* column : {&relief->shape, &relief->color, &relief->tint}) {
    *column = {reinterpret_cast<const std::uint32_t*>(next), texels};
    next += 4 * texels;
  }
  return relief;
}

/// The colours of coarse levels; none where there is no section.
absl::StatusOr<CornerTones> read_corner_tones(std::span<const std::byte> bytes) {
  CornerTones tones;
  if (bytes.empty()) return tones;
  layout::CornerToneHeader header{};
  if (bytes.size() < sizeof(header)) {
    return absl::InvalidArgumentError(absl::StrCat("corner tone: has ", bytes.size(),
                                                   " bytes, must have at least ", sizeof(header)));
  }
  std::memcpy(&header, bytes.data(), sizeof(header));
  if (header.version != layout::kCornerToneVersion) {
    return absl::FailedPreconditionError(
        absl::StrCat("corner tone: version is ", header.version, ", this program reads ",
                     layout::kCornerToneVersion, "; bake the character again"));
  }
  const std::uint64_t bands = header.band_count, triangles = header.triangle_count;
  const std::uint64_t size = sizeof(header) + bands * sizeof(ToneBand) + 12 * triangles;
  if (size != bytes.size()) {
    return absl::InvalidArgumentError(absl::StrCat("corner tone: has ", bytes.size(), " bytes, ",
                                                   bands, " bands and ", triangles,
                                                   " triangles, which need ", size));
  }
  const std::byte* next = bytes.data() + sizeof(header);
  tones.band = {reinterpret_cast<const ToneBand*>(next), bands};
  next += bands * sizeof(ToneBand);
  tones.tone = {reinterpret_cast<const std::uint32_t*>(next), 3 * triangles};
  return tones;
}

absl::StatusOr<Character> read_sections(std::span<const std::byte> file) {
  SectionReader sections(file);
  if (auto status = sections.check(); !status.ok()) return status;

  const std::span<const layout::Info> infos = sections.get<layout::Info>(Section::kInfo, 1);
  if (!sections.status().ok()) return sections.status();
  const layout::Info& info = infos[0];
  const std::uint64_t vertices = info.vertex_count;
  const std::uint64_t triangles = info.triangle_count;

  Character character;
  character.name = sections.text(info.name);
  character.position = sections.get<glm::vec3>(Section::kPosition, vertices);
  character.normal = sections.get<glm::i16vec2>(Section::kNormal, vertices);
  character.uv = sections.get<glm::u16vec2>(Section::kUv, vertices);
  character.joint_index = sections.get<glm::u8vec4>(Section::kJointIndex, vertices);
  character.joint_weight = sections.get<glm::u8vec4>(Section::kJointWeight, vertices);
  character.collapse_target = sections.get<std::uint32_t>(Section::kCollapseTarget, vertices);
  character.triangle = sections.get<glm::uvec3>(Section::kTriangle, triangles);
  character.triangle_flags = sections.get<std::uint8_t>(Section::kTriangleFlags, triangles);
  character.triangle_count_at =
      sections.get<std::uint32_t>(Section::kTriangleCountAt, vertices + 1);
  character.legal_count = sections.get<std::uint32_t>(Section::kLegalCount, vertices + 1);
  character.collapse_error_m = sections.get<float>(Section::kCollapseError, vertices);
  character.coarsest_count = info.coarsest_count;
  for (const layout::JointRecord& joint :
       sections.get<layout::JointRecord>(Section::kJoint, info.joint_count)) {
    character.joints.push_back({sections.text(joint.name), joint.parent, joint.joint_from_model});
    if (!sections.status().ok()) return sections.status();
  }
  for (const layout::ClipRecord& clip :
       sections.get<layout::ClipRecord>(Section::kClip, info.clip_count)) {
    character.clips.push_back({sections.text(clip.name), static_cast<ClipKind>(clip.kind),
                               clip.first_frame, clip.frame_count, clip.rate_hz, clip.loop != 0,
                               clip.stride_m, clip.speed_mps});
    if (!sections.status().ok()) return sections.status();
  }
  character.palette =
      sections.get<Affine>(Section::kPalette, std::uint64_t{info.frame_count} * info.joint_count);
  character.bounds = {info.bounds[0], info.bounds[1], info.bounds[2], info.bounds[3]};
  character.gait_bounds = {info.gait_bounds[0], info.gait_bounds[1], info.gait_bounds[2],
                           info.gait_bounds[3]};
  if (character.gait_bounds.w == 0.0F) character.gait_bounds = character.bounds;
  character.height_m = info.height_m;
  character.base_color = read_image(sections, Section::kBaseColor, info.base_color_width_px,
                                    info.base_color_height_px, info.base_color_levels);
  if (info.tint_mask_width_px != 0 || info.tint_mask_height_px != 0 || info.tint_mask_levels != 0) {
    character.tint_mask = read_image(sections, Section::kTintMask, info.tint_mask_width_px,
                                     info.tint_mask_height_px, info.tint_mask_levels);
  }
  if (info.point_count > layout::kMaxPoints) {
    return absl::InvalidArgumentError(
        absl::StrCat("info: point count is ", info.point_count, ", limit ", layout::kMaxPoints));
  }
  if (info.point_count > 0) {
    character.points.point = sections.get<SurfacePoint>(Section::kPoint, info.point_count);
    character.points.radius_m = sections.get<float>(Section::kPointRadius, info.point_count);
    character.points.tone =
        sections.get<PointTone>(Section::kPointTone, point_tone_count(info.point_count));
  }
  if (!sections.status().ok()) return sections.status();
  auto relief = read_relief(sections.bytes(Section::kImpostor));
  if (!relief.ok()) return relief.status();
  character.relief = *std::move(relief);
  auto tones = read_corner_tones(sections.bytes(Section::kCornerTone));
  if (!tones.ok()) return tones.status();
  character.corner_tones = *tones;
  if (auto status = validate(character); !status.ok()) return status;
  return character;
}

}  // namespace

absl::StatusOr<Character> read_character(const std::string& path) {
  auto file = map_file(path);
  if (!file.ok()) return file.status();
  auto character = read_sections({(*file)->data(), (*file)->size()});
  if (!character.ok()) {
    return absl::Status(character.status().code(),
                        absl::StrCat(path, ": ", character.status().message()));
  }
  if (character->relief != nullptr) {
    auto relief = std::make_shared<Relief>(*character->relief);
    relief->storage = *file;  // it may outlive the character
    character->relief = std::move(relief);
  }
  character->storage = *std::move(file);
  return character;
}

}  // namespace throng::render
