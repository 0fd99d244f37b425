#include "sorted_reader.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

namespace throng::trajectory::detail {

void clear_frame(const Columns& columns, std::int64_t time_us, Frame& frame) {
  frame.time_us = time_us;
  frame.ids.clear();
  frame.x_m.clear();
  frame.y_m.clear();
  frame.z_m.clear();
  frame.heading_rad.clear();
  frame.motion.clear();
  frame.channels.resize(columns.channels);
  for (std::vector<float>& channel : frame.channels) channel.clear();
}

void append_row(const Columns& columns, std::uint64_t id, std::span<const double> values,
                Frame& frame) {
  frame.ids.push_back(id);
  frame.x_m.push_back(values[0]);
  frame.y_m.push_back(values[1]);
  std::size_t next = 2;
  if (columns.z) frame.z_m.push_back(values[next++]);
  if (columns.heading) frame.heading_rad.push_back(static_cast<float>(values[next++]));
  if (columns.motion) frame.motion.push_back(static_cast<std::uint8_t>(values[next++]));
  for (std::size_t i = 0; i < columns.channels; ++i) {
    frame.channels[i].push_back(static_cast<float>(values[next + i]));
  }
}

namespace {

absl::Status too_long(const std::string& path, double span_s) {
  return fault(path, absl::StrCat("the file spans ", number_text(span_s), " seconds, at most ",
                                  number_text(kMaxTimeS),
                                  " are allowed; check its frame numbers and its rate"));
}

class SortedReader final : public Reader {
 public:
  SortedReader(std::string path, Info info, Columns columns, bool times, double keys_per_s,
               double step, std::unique_ptr<RowSorter> rows, IdTable ids,
               std::unique_ptr<RowFeed> feed)
      : path_(std::move(path)),
        info_(std::move(info)),
        columns_(columns),
        times_(times),
        keys_per_s_(keys_per_s),
        step_(step),
        feed_(std::move(feed)),
        rows_(std::move(rows)),
        own_ids_(std::move(ids)) {}

  const Info& info() const override { return info_; }
  std::string agent_name(std::uint64_t id) const override { return ids().name(id); }
  std::int32_t agent_character(std::uint64_t id) const override { return ids().character(id); }
  std::int64_t frames_inserted() const override { return inserted_; }

  absl::StatusOr<bool> next(Frame& frame) override {
    if (!pending_) {
      absl::StatusOr<bool> more = gather();
      if (!more.ok()) return more.status();
      if (!*more) return false;
      if (given_ && everybody_left()) {
        pending_ = true;
        ++inserted_;
        last_ids_.clear();
        const std::int64_t left_us = std::max<std::int64_t>(
            last_us_ + 1, time_us(last_key_) + std::llround(step_ * 1e6 / keys_per_s_));
        clear_frame(columns_, std::min(left_us, gathered_.time_us - 1), frame);
        last_us_ = frame.time_us;
        return true;
      }
    }
    pending_ = false;
    std::swap(frame, gathered_);
    last_us_ = frame.time_us;
    last_key_ = key_;
    last_ids_ = frame.ids;
    given_ = true;
    return true;
  }

 private:
  const IdTable& ids() const { return feed_ != nullptr ? feed_->ids() : own_ids_; }

  std::int64_t time_us(std::int64_t key) const {
    const double keys = static_cast<double>(key) - static_cast<double>(rows_->first_key());
    return times_ ? key - rows_->first_key() : std::llround(keys * 1e6 / keys_per_s_);
  }

  absl::StatusOr<bool> gather() {
    if (!started_) {
      started_ = true;
      absl::StatusOr<bool> more = rows_->next(row_);
      if (!more.ok()) return more.status();
      at_end_ = !*more;
    }
    if (at_end_) return false;
    key_ = row_.key;
    const double span_s =
        (static_cast<double>(key_) - static_cast<double>(rows_->first_key())) / keys_per_s_;
    if (!(span_s <= kMaxTimeS)) return too_long(path_, span_s);
    if (given_ && time_us(key_) <= last_us_) {
      return fault(path_, row_.line,
                   absl::StrCat("frame ", key_, " is less than a microsecond after frame ",
                                last_key_, "; check the frame numbers and their rate"));
    }
    clear_frame(columns_, time_us(key_), gathered_);
    std::uint64_t line = 0;
    while (row_.key == key_) {
      if (row_.line != 0) {
        if (!gathered_.ids.empty() && gathered_.ids.back() == row_.id) return twice(line);
        if (gathered_.ids.size() >= kMaxAgentsPerFrame) {
          return fault(path_, row_.line,
                       absl::StrCat("more than ", kMaxAgentsPerFrame, " agents in one frame"));
        }
        append_row(columns_, row_.id, row_.values, gathered_);
        line = row_.line;
      }
      absl::StatusOr<bool> more = rows_->next(row_);
      if (!more.ok()) return more.status();
      if (!*more) {
        at_end_ = true;
        break;
      }
    }
    if (feed_ != nullptr && feed_->motion_names().size() > info_.motion_names.size()) {
      info_.motion_names = feed_->motion_names();
    }
    return true;
  }

  absl::Status twice(std::uint64_t line) const {
    const std::string name = ids().name(row_.id);
    return fault(
        path_, row_.line,
        absl::StrCat(
            "agent ", name.empty() ? absl::StrCat(row_.id) : quoted(name), " is there twice ",
            times_ ? absl::StrCat("at time ", number_text(1e-6 * static_cast<double>(key_)), " s")
                   : absl::StrCat("in frame ", key_),
            ", first in line ", line, "; remove one of the two rows"));
  }

  bool everybody_left() const {
    if (last_ids_.empty() || gathered_.ids.empty()) return false;
    const double gap = static_cast<double>(key_) - static_cast<double>(last_key_);
    if (!(gap > 1.5 * step_) || gathered_.time_us - last_us_ < 2) return false;
    // Both lists are in order.
    auto a = last_ids_.begin();
    auto b = gathered_.ids.begin();
    while (a != last_ids_.end() && b != gathered_.ids.end()) {
      if (*a == *b) return false;
      *a < *b ? ++a : ++b;
    }
    return true;
  }

  std::string path_;
  Info info_;
  Columns columns_;
  bool times_;
  double keys_per_s_;
  double step_;
  std::unique_ptr<RowFeed> feed_;
  std::unique_ptr<RowSorter> rows_;
  IdTable own_ids_;

  RowSorter::Row row_;
  bool started_ = false, at_end_ = false;
  Frame gathered_;
  std::int64_t key_ = 0;
  bool pending_ = false;  // gathered_ was read but an empty frame went first
  bool given_ = false;
  std::int64_t last_key_ = 0, last_us_ = 0;
  std::vector<std::uint64_t> last_ids_;
  std::int64_t inserted_ = 0;
};

/// The usual distance of the keys.
double usual_step(const std::vector<std::int64_t>& keys) {
  if (keys.size() < 2) return 1.0;
  std::vector<std::int64_t> gaps(keys.size() - 1);
  for (std::size_t i = 0; i < gaps.size(); ++i) gaps[i] = keys[i + 1] - keys[i];
  const auto middle = gaps.begin() + static_cast<std::ptrdiff_t>(gaps.size() / 2);
  std::nth_element(gaps.begin(), middle, gaps.end());
  return static_cast<double>(*middle);
}

}  // namespace

absl::StatusOr<std::unique_ptr<Reader>> make_sorted_reader(
    const std::string& path, Info info, Columns columns, TimeBase base, const ReadOptions& options,
    std::unique_ptr<RowSorter> rows, IdTable ids, std::unique_ptr<RowFeed> feed) {
  if (rows->empty()) {
    return fault(path, "there are no rows of agents in the file; it may have been cut short");
  }
  if (feed != nullptr) {
    rows->stream([from = feed.get(), to = rows.get()] { return from->read_on(*to); });
  } else if (absl::Status status = rows->finish(); !status.ok()) {
    return status;
  }
  const double step = usual_step(rows->keys());
  double keys_per_s = 1e6;
  const bool times = base.kind == TimeBase::Kind::kMicroseconds;
  if (times) {
    info.fps = regular_fps(rows->keys());
    if (options.source_fps) {
      // Times in the file always win, so a rate beside them can only agree.
      std::optional<double> of_file;
      if (info.fps > 0.0) of_file = info.fps;
      if (!of_file && rows->keys().size() > 1) {
        return fault(path,
                     "--source-fps was given but the file has its own, irregular times; leave "
                     "--source-fps out");
      }
      absl::StatusOr<double> fps = resolve_fps(path, of_file, options, "");
      if (!fps.ok()) return fps.status();
    }
  } else {
    keys_per_s = base.kind == TimeBase::Kind::kSamples ? base.rate * step : base.rate;
    info.fps = keys_per_s / step;
    if (step > 1.0) {
      info.notes.push_back(absl::StrCat("frame numbers go up by ", number_text(step), ": ",
                                        number_text(info.fps), " samples per second"));
    }
  }
  const double span_s =
      (static_cast<double>(rows->last_key()) - static_cast<double>(rows->first_key())) / keys_per_s;
  if (!(span_s <= kMaxTimeS)) return too_long(path, span_s);
  if (rows->spilled()) {
    info.notes.push_back(
        absl::StrCat(rows->row_count(), " rows sorted by time through a temporary file"));
  }
  return std::unique_ptr<Reader>(
      std::make_unique<SortedReader>(path, std::move(info), columns, times, keys_per_s, step,
                                     std::move(rows), std::move(ids), std::move(feed)));
}

}  // namespace throng::trajectory::detail
