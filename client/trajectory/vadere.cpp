#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <unordered_map>

#include "readers.hpp"
#include "sorted_reader.hpp"
#include "text_source.hpp"

/// Vadere's footsteps: each row is one step of one pedestrian, from a place and time to another.
/// Between the two the way is a straight line, so a frame of any time is exact. Frames come at a
/// fixed rate: 10 a second, or as --source-fps says.
namespace throng::trajectory::detail {
namespace {

constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
constexpr double kUsualFps = 10.0;
/// Eleven days at the usual rate: more is a broken time.
constexpr double kMaxFrames = 1e7;

struct Step {
  double start_s = 0, end_s = 0;
  double from_x = 0, from_y = 0, to_x = 0, to_y = 0;
  float heading_rad = std::numeric_limits<float>::quiet_NaN();
  std::vector<float> channels;
};

class VadereReader final : public Reader {
 public:
  VadereReader(std::string path, Info info, double first_s, double last_s, std::size_t channels,
               std::unordered_map<std::uint64_t, double> leaves_s, std::unique_ptr<RowSorter> steps)
      : path_(std::move(path)),
        info_(std::move(info)),
        first_s_(first_s),
        last_s_(last_s),
        channels_(channels),
        leaves_s_(std::move(leaves_s)),
        steps_(std::move(steps)) {}

  const Info& info() const override { return info_; }

  absl::StatusOr<bool> next(Frame& frame) override {
    const double since_s = static_cast<double>(index_) / info_.fps;
    const double now_s = first_s_ + since_s;
    // The last step's end may fall on a frame but for rounding.
    if (now_s > last_s_ + 1e-9) return false;
    ++index_;
    while (!at_end_ && (!have_row_ || row_.values[0] <= now_s)) {
      if (have_row_) take_step();
      absl::StatusOr<bool> more = steps_->next(row_);
      if (!more.ok()) return more.status();
      have_row_ = *more;
      at_end_ = !*more;
    }
    Columns columns;
    columns.channels = channels_;
    clear_frame(columns, std::llround(since_s * 1e6), frame);
    for (auto agent = walking_.begin(); agent != walking_.end();) {
      const auto& [id, step] = *agent;
      if (now_s > leaves_s_.at(id) + 1e-9) {
        agent = walking_.erase(agent);
        continue;
      }
      const double length_s = step.end_s - step.start_s;
      const double part =
          length_s > 0.0 ? std::clamp((now_s - step.start_s) / length_s, 0.0, 1.0) : 1.0;
      frame.ids.push_back(id);
      frame.x_m.push_back(step.from_x + part * (step.to_x - step.from_x));
      frame.y_m.push_back(step.from_y + part * (step.to_y - step.from_y));
      frame.heading_rad.push_back(step.heading_rad);
      for (std::size_t i = 0; i < channels_; ++i) frame.channels[i].push_back(step.channels[i]);
      ++agent;
    }
    return true;
  }

 private:
  void take_step() {
    Step& step = walking_[row_.id];
    step.start_s = row_.values[0];
    step.end_s = row_.values[1];
    step.from_x = row_.values[2];
    step.from_y = row_.values[3];
    step.to_x = row_.values[4];
    step.to_y = row_.values[5];
    const double dx = step.to_x - step.from_x, dy = step.to_y - step.from_y;
    // A step on the spot keeps the heading of the step before.
    if (std::hypot(dx, dy) > 1e-6) step.heading_rad = static_cast<float>(std::atan2(dy, dx));
    step.channels.resize(channels_);
    for (std::size_t i = 0; i < channels_; ++i) {
      step.channels[i] = static_cast<float>(row_.values[6 + i]);
    }
  }

  std::string path_;
  Info info_;
  double first_s_, last_s_;
  std::size_t channels_;
  std::unordered_map<std::uint64_t, double> leaves_s_;  // end of the last step of each
  std::unique_ptr<RowSorter> steps_;
  RowSorter::Row row_;
  bool have_row_ = false, at_end_ = false;
  std::map<std::uint64_t, Step> walking_;  // ordered: frames list agents by id
  std::int64_t index_ = 0;
};

class Ingest {
 public:
  Ingest(const std::string& path, const ReadOptions& options) : path_(path), options_(options) {}

  ReaderOr run() {
    if (absl::Status s = require_metres(path_, options_, "Vadere"); !s.ok()) return s;
    absl::StatusOr<double> fps = resolve_fps(
        path_, options_.source_fps ? std::nullopt : std::optional<double>(kUsualFps), options_, "");
    if (!fps.ok()) return fps.status();
    info_.format = "vadere-traj";
    info_.fps = *fps;

    absl::StatusOr<std::unique_ptr<LineSource>> lines = LineSource::open(path_);
    if (!lines.ok()) return lines.status();
    std::string_view line;
    std::vector<std::string_view> fields;
    while (true) {
      absl::StatusOr<bool> more = (*lines)->next(line);
      if (!more.ok()) return more.status();
      if (!*more) break;
      if (absl::Status s = (*lines)->tell(options_); !s.ok()) return s;
      line = trimmed(line);
      if (line.empty() || line.front() == '#') continue;
      split_blanks(line, fields);
      if (fields.size() > kMaxColumns) {
        return fault(path_, (*lines)->number(),
                     absl::StrCat("more than ", kMaxColumns, " columns"));
      }
      const absl::Status status = names_.empty()
                                      ? read_names((*lines)->number(), fields)
                                      : add((*lines)->number(), fields, (*lines)->unterminated());
      if (!status.ok()) return status;
    }
    if (steps_ == nullptr || steps_->empty()) {
      return fault(path_, "there are no footsteps in the file; it may have been cut short");
    }
    const double span_s = last_s_ - first_s_;
    if (!(span_s * info_.fps <= kMaxFrames)) {
      return fault(path_, absl::StrCat("the footsteps span ", number_text(span_s), " s, ",
                                       number_text(span_s * info_.fps), " frames at ",
                                       number_text(info_.fps),
                                       " a second; at most 1e7 frames are "
                                       "read: correct the times or give a lower --source-fps"));
    }
    if (absl::Status s = steps_->finish(); !s.ok()) return s;
    info_.notes.push_back(absl::StrCat(steps_->row_count(), " footsteps, shown at ",
                                       number_text(info_.fps),
                                       " frames per second; --source-fps gives another rate"));
    return std::unique_ptr<Reader>(
        std::make_unique<VadereReader>(path_, std::move(info_), first_s_, last_s_, channels_.size(),
                                       std::move(leaves_s_), std::move(steps_)));
  }

 private:
  absl::Status read_names(std::uint64_t number, const std::vector<std::string_view>& fields) {
    for (const std::string_view field : fields) {
      // "endX-PID7": which processor wrote a column is nobody's business.
      const std::string_view bare = field.substr(0, field.find("-PID"));
      const std::string name = lower(bare);
      const std::size_t column = names_.size();
      names_.emplace_back(bare);
      std::size_t* role = nullptr;
      if (name == "pedestrianid" || name == "id") role = &id_;
      if (name == "simtime" || name == "time" || name == "starttime") role = &start_;
      if (name == "endtime") role = &end_;
      if (name == "startx") role = &from_x_;
      if (name == "starty") role = &from_y_;
      if (name == "endx") role = &to_x_;
      if (name == "endy") role = &to_y_;
      if (role == nullptr) {
        channels_.push_back(column);
      } else if (*role != kNone) {
        return fault(path_, number, absl::StrCat("column ", quoted(bare), " is there twice"));
      } else {
        *role = column;
      }
    }
    for (const auto& [role, name] :
         {std::pair(id_, "pedestrianId"), std::pair(start_, "simTime"), std::pair(end_, "endTime"),
          std::pair(from_x_, "startX"), std::pair(from_y_, "startY"), std::pair(to_x_, "endX"),
          std::pair(to_y_, "endY")}) {
      if (role == kNone) {
        return fault(path_, number,
                     absl::StrCat("no column named ", name,
                                  "; let Vadere write it with a FootStepProcessor"));
      }
    }
    return absl::OkStatus();
  }

  absl::Status add(std::uint64_t line, const std::vector<std::string_view>& fields,
                   bool unterminated) {
    if (fields.size() != names_.size()) {
      return fault(
          path_, line,
          absl::StrCat("the row has ", fields.size(), " columns, the header names ", names_.size(),
                       unterminated ? "; the file is cut short: remove its last line"
                                    : "; correct or remove the row"));
    }
    if (steps_ == nullptr) begin(fields);
    std::int64_t id = 0;
    if (!parse_integer(fields[id_], id) || id < 0) {
      return fault(
          path_, line,
          absl::StrCat("pedestrianId is ", quoted(fields[id_]), ", must be an integer from 0"));
    }
    values_.clear();
    for (const std::size_t column : {start_, end_, from_x_, from_y_, to_x_, to_y_}) {
      double value = 0.0;
      if (!parse_number(fields[column], value)) {
        return fault(path_, line,
                     absl::StrCat(names_[column], " is ", quoted(fields[column]),
                                  ", must be a number; correct or remove the row"));
      }
      const bool time = column == start_ || column == end_;
      if (time && !(std::abs(value) <= kMaxTimeS)) {
        return fault(path_, line,
                     absl::StrCat(names_[column], " is ", number_text(value),
                                  " s, must be between -1e12 and 1e12 s"));
      }
      if (!time) {
        const char axis = column == from_x_ || column == to_x_ ? 'x' : 'y';
        if (absl::Status s = check_position(path_, line, axis, value); !s.ok()) return s;
      }
      values_.push_back(value);
    }
    const double start_s = values_[0], end_s = values_[1];
    if (end_s < start_s) {
      return fault(path_, line,
                   absl::StrCat("endTime is ", number_text(end_s), ", before simTime ",
                                number_text(start_s), "; correct or remove the row"));
    }
    for (const std::size_t column : channels_) {
      double value = 0.0;
      if (!parse_number(fields[column], value) || !(std::abs(value) <= 3e38)) {
        value = std::numeric_limits<double>::quiet_NaN();
      }
      values_.push_back(value);
    }
    const bool first = steps_->empty();
    first_s_ = first ? start_s : std::min(first_s_, start_s);
    last_s_ = first ? end_s : std::max(last_s_, end_s);
    const auto agent = static_cast<std::uint64_t>(id);
    double& leaves_s = leaves_s_.try_emplace(agent, end_s).first->second;
    leaves_s = std::max(leaves_s, end_s);
    return steps_->add(std::llround(start_s * 1e6), agent, line, values_);
  }

  /// Columns beyond the steps are channels when the first row has numbers there.
  void begin(const std::vector<std::string_view>& fields) {
    std::vector<std::size_t> channels;
    for (const std::size_t column : channels_) {
      double value = 0.0;
      if (!parse_number(fields[column], value)) {
        info_.notes.push_back(
            absl::StrCat("column ", quoted(names_[column]), " is not a number and is ignored"));
        continue;
      }
      channels.push_back(column);
      info_.channel_names.push_back(names_[column]);
    }
    channels_ = std::move(channels);
    steps_ = std::make_unique<RowSorter>(6 + channels_.size(), options_.memory_bytes);
  }

  const std::string& path_;
  const ReadOptions& options_;
  Info info_;
  std::vector<std::string> names_;
  std::size_t id_ = kNone, start_ = kNone, end_ = kNone, from_x_ = kNone, from_y_ = kNone,
              to_x_ = kNone, to_y_ = kNone;
  std::vector<std::size_t> channels_;
  std::vector<double> values_;
  double first_s_ = 0.0, last_s_ = 0.0;
  std::unordered_map<std::uint64_t, double> leaves_s_;
  std::unique_ptr<RowSorter> steps_;
};

}  // namespace

ReaderOr open_vadere(const std::string& path, const ReadOptions& options) {
  return Ingest(path, options).run();
}

}  // namespace throng::trajectory::detail
