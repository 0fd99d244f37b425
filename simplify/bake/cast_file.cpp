#include "simplify/bake/cast_file.hpp"

#include <absl/strings/str_cat.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>

namespace throng::simplify {

using Json = nlohmann::ordered_json;

absl::StatusOr<CastFile> CastFile::open(const std::string& folder) {
  CastFile cast;
  cast.path_ = (std::filesystem::path(folder) / "cast.json").string();
  cast.json_ = R"({"throng_cast": 1, "characters": []})";
  std::error_code error;
  if (!std::filesystem::exists(cast.path_, error)) return cast;
  std::ifstream file(cast.path_, std::ios::binary);
  cast.json_.assign(std::istreambuf_iterator<char>(file), {});
  const Json json = Json::parse(cast.json_, nullptr, /*allow_exceptions=*/false);
  const bool is_cast = json.is_object() && json.contains("throng_cast") &&
                       json["throng_cast"] == 1 && json.contains("characters") &&
                       json["characters"].is_array();
  if (!is_cast) {
    return absl::InvalidArgumentError(absl::StrCat(
        cast.path_, ": is not a cast of version 1; mend it or bake into another folder"));
  }
  for (std::size_t i = 0; i < json["characters"].size(); ++i) {
    const Json& entry = json["characters"][i];
    if (!entry.is_object() || !entry.contains("file") || !entry["file"].is_string()) {
      return absl::InvalidArgumentError(
          absl::StrCat(cast.path_, ": characters[", i, "] has no file"));
    }
    const auto text = [&](const char* key) {
      return entry.contains(key) && entry[key].is_string() ? entry[key].get<std::string>()
                                                           : std::string();
    };
    CastEntry known{text("name"), text("file"), text("source"), text("tool")};
    if (entry.contains("bake_s") && entry["bake_s"].is_number())
      known.bake_s = entry["bake_s"].get<double>();
    if (entry.contains("pose_frames") && entry["pose_frames"].is_array()) {
      auto& frames = known.pose_frames.emplace();
      for (const Json& frame : entry["pose_frames"]) {
        if (!frame.is_number_unsigned() ||
            frame.get<std::uint64_t>() > std::numeric_limits<std::uint32_t>::max()) {
          return absl::InvalidArgumentError(absl::StrCat(cast.path_, ": characters[", i,
                                                         "] has pose_frames of ", frame.dump(),
                                                         ", must be numbers of frames"));
        }
        frames.push_back(frame.get<std::uint32_t>());
      }
    }
    if (known.name.empty()) known.name = std::filesystem::path(known.file).stem().string();
    cast.entries_.push_back(std::move(known));
  }
  return cast;
}

const CastEntry* CastFile::find(const std::string& name) const {
  for (const CastEntry& entry : entries_) {
    if (entry.name == name) return &entry;
  }
  return nullptr;
}

void CastFile::put(const CastEntry& entry) {
  for (CastEntry& known : entries_) {
    if (known.name != entry.name) continue;
    known = entry;
    return;
  }
  entries_.push_back(entry);
}

absl::Status CastFile::save() const {
  Json json = Json::parse(json_, nullptr, /*allow_exceptions=*/false);
  Json old = json["characters"];
  std::vector<CastEntry> sorted = entries_;
  std::sort(sorted.begin(), sorted.end(),
            [](const CastEntry& a, const CastEntry& b) { return a.name < b.name; });
  Json characters = Json::array();
  for (const CastEntry& entry : sorted) {
    Json written = {{"name", entry.name}, {"file", entry.file}, {"weight", 1.0}};
    for (const Json& known : old) {
      if (known.contains("file") && known["file"] == entry.file) written.update(known);
    }
    written["name"] = entry.name;
    written["source"] = entry.source;
    written["tool"] = entry.tool;
    if (entry.bake_s >= 0.0) written["bake_s"] = std::round(entry.bake_s * 100.0) / 100.0;
    if (entry.pose_frames.has_value()) written["pose_frames"] = *entry.pose_frames;
    characters.push_back(std::move(written));
  }
  json["characters"] = std::move(characters);

  const std::string temporary = absl::StrCat(path_, ".tmp", ::getpid());
  {
    std::ofstream file(temporary, std::ios::binary | std::ios::trunc);
    file << json.dump(2) << '\n';
    file.flush();
    if (!file) {
      std::remove(temporary.c_str());
      return absl::UnavailableError(absl::StrCat(temporary, ": can't be written"));
    }
  }
  if (std::rename(temporary.c_str(), path_.c_str()) != 0) {
    std::remove(temporary.c_str());
    return absl::UnavailableError(absl::StrCat(path_, ": can't be replaced"));
  }
  return absl::OkStatus();
}

}  // namespace throng::simplify
