#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace throng::simplify {

/// What throng-bake knows of a member of a cast; the rest of its entry belongs to the user.
struct CastEntry {
  std::string name;
  std::string file;      // in the cast's folder
  std::string source;    // content hash of the input
  std::string tool;      // program and settings
  double bake_s = -1.0;  // seconds from reading the input to the checked mesh; negative: not known
  /// Frames of the palette that the levels were judged in, beside the bind pose; none: not known.
  std::optional<std::vector<std::uint32_t>> pose_frames{};
};

/// A folder's cast.json while it is extended. Weights, clip overrides and whatever else users wrote
/// into an entry are kept.
class CastFile {
 public:
  /// An empty cast where the folder has none. InvalidArgument where cast.json is there but broken:
  /// it may hold work of the user, so it is not replaced.
  static absl::StatusOr<CastFile> open(const std::string& folder);

  const std::vector<CastEntry>& entries() const { return entries_; }
  const CastEntry* find(const std::string& name) const;
  void put(const CastEntry& entry);

  /// Writes atomically, members by name. Unavailable when it can't be written.
  absl::Status save() const;

 private:
  std::string path_;
  std::string json_;  // as it was read
  std::vector<CastEntry> entries_;
};

}  // namespace throng::simplify
