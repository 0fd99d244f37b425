#include <absl/strings/str_cat.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "readers.hpp"
#include "sorted_reader.hpp"
#include "text_source.hpp"

/// TrajNet++: one JSON object a line, {"scene": {id, p, s, e, fps, tag}} or {"track": {f, p, x,
/// y}}. Frame numbers keep the numbering of the video, the rate of a scene is that of the samples.
namespace throng::trajectory::detail {
namespace {

using Json = nlohmann::json;

class Ingest {
 public:
  Ingest(const std::string& path, const ReadOptions& options) : path_(path), options_(options) {}

  ReaderOr run() {
    if (absl::Status s = require_metres(path_, options_, "TrajNet++"); !s.ok()) return s;
    info_.format = "trajnet-ndjson";
    rows_ = std::make_unique<RowSorter>(columns_.count(), options_.memory_bytes);
    absl::StatusOr<std::unique_ptr<LineSource>> lines = LineSource::open(path_);
    if (!lines.ok()) return lines.status();
    std::string_view line;
    while (true) {
      absl::StatusOr<bool> more = (*lines)->next(line);
      if (!more.ok()) return more.status();
      if (!*more) break;
      if (absl::Status s = (*lines)->tell(options_); !s.ok()) return s;
      line = trimmed(line);
      if (line.empty()) continue;
      const std::uint64_t number = (*lines)->number();
      const Json object = Json::parse(line.begin(), line.end(), nullptr, false);
      if (!object.is_object()) {
        return fault(path_, number,
                     absl::StrCat("the line is ", quoted(line), ", must be one JSON object",
                                  (*lines)->unterminated() && number > 1
                                      ? "; the file is cut short: remove its last line"
                                      : " a line as of TrajNet++"));
      }
      const auto track = object.find("track");
      const auto scene = object.find("scene");
      absl::Status status;
      if (track != object.end()) {
        status = add(number, *track);
      } else if (scene != object.end()) {
        status = read_scene(number, *scene);
      } else {
        status = fault(path_, number, "the object has neither 'track' nor 'scene'");
      }
      if (!status.ok()) return status;
    }
    if (rows_->empty()) return fault(path_, "there are no tracks in the file; it may be cut short");
    absl::StatusOr<double> fps = resolve_fps(
        path_, fps_, options_, "no scene of the file says its samples per second (2.5 is usual)");
    if (!fps.ok()) return fps.status();
    if (predictions_ > 0) {
      info_.notes.push_back(
          absl::StrCat(counted(predictions_, "row", "rows"), " of predictions skipped"));
    }
    return make_sorted_reader(path_, std::move(info_), columns_, {TimeBase::Kind::kSamples, *fps},
                              without_rate(), std::move(rows_), IdTable(false));
  }

 private:
  ReadOptions without_rate() const {
    ReadOptions options = options_;
    options.source_fps.reset();  // resolved already
    return options;
  }

  absl::Status read_scene(std::uint64_t number, const Json& scene) {
    if (!scene.is_object()) return fault(path_, number, "'scene' must be an object");
    const auto fps = scene.find("fps");
    if (fps == scene.end() || fps->is_null()) return absl::OkStatus();
    if (!fps->is_number()) return fault(path_, number, "fps of the scene must be a number");
    const double value = fps->get<double>();
    if (fps_ && !same_rate(*fps_, value)) {
      return fault(path_, number,
                   absl::StrCat("fps is ", number_text(value), " here and ", number_text(*fps_),
                                " in an earlier scene; split the "
                                "file"));
    }
    fps_ = value;
    return absl::OkStatus();
  }

  absl::Status integer(std::uint64_t line, const Json& track, const char* key,
                       std::int64_t& value) const {
    const auto entry = track.find(key);
    if (entry != track.end() && entry->is_number()) {
      const double number = entry->get<double>();
      if (number == std::floor(number) && std::abs(number) <= kMaxInteger) {
        value = static_cast<std::int64_t>(number);
        return absl::OkStatus();
      }
    }
    return fault(path_, line,
                 absl::StrCat(key, " of the track must be an integer of at most 2^53"));
  }

  absl::Status add(std::uint64_t line, const Json& track) {
    if (!track.is_object()) return fault(path_, line, "'track' must be an object");
    const auto prediction = track.find("prediction_number");
    if (prediction != track.end() && !prediction->is_null()) {
      ++predictions_;
      return absl::OkStatus();
    }
    std::int64_t frame = 0, id = 0;
    if (absl::Status s = integer(line, track, "f", frame); !s.ok()) return s;
    if (absl::Status s = integer(line, track, "p", id); !s.ok()) return s;
    if (id < 0) return fault(path_, line, absl::StrCat("p is ", id, ", must be from 0"));
    double values[2];
    for (int axis = 0; axis < 2; ++axis) {
      const char* key = axis == 0 ? "x" : "y";
      const auto entry = track.find(key);
      if (entry == track.end() || !entry->is_number()) {
        return fault(path_, line,
                     absl::StrCat(key,
                                  " of the track must be a number; correct or "
                                  "remove the line"));
      }
      values[axis] = entry->get<double>();
      if (auto s = check_position(path_, line, *key, values[axis]); !s.ok()) return s;
    }
    return rows_->add(frame, static_cast<std::uint64_t>(id), line, values);
  }

  const std::string& path_;
  const ReadOptions& options_;
  Info info_;
  Columns columns_;
  std::optional<double> fps_;
  std::uint64_t predictions_ = 0;
  std::unique_ptr<RowSorter> rows_;
};

}  // namespace

ReaderOr open_trajnet(const std::string& path, const ReadOptions& options) {
  return Ingest(path, options).run();
}

}  // namespace throng::trajectory::detail
