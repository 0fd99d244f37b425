#include <absl/strings/str_cat.h>

#include <cmath>
#include <deque>

#include "readers.hpp"
#include "sorted_reader.hpp"
#include "text_source.hpp"

/// Output of the RVO2 examples: "time (x,y) (x,y) ..." in each line, agents by their order.
namespace throng::trajectory::detail {
namespace {

constexpr std::size_t kMaxLineBytes = 256u << 20;

class Rvo2Reader final : public Reader {
 public:
  explicit Rvo2Reader(std::string path) : path_(std::move(path)) { info_.format = "rvo2-text"; }

  absl::Status open(const ReadOptions& options) {
    std::optional<double> unit = options.source_unit_m ? std::nullopt : std::optional<double>(1.0);
    absl::StatusOr<double> unit_m = resolve_unit(path_, unit, options);
    if (!unit_m.ok()) return unit_m.status();
    unit_m_ = *unit_m;
    if (unit) {
      info_.notes.push_back(
          "positions taken as metres; the RVO2 examples are not to human scale, "
          "give the metres of one unit, such as --source-unit 0.2");
    }
    absl::StatusOr<std::unique_ptr<LineSource>> lines = LineSource::open(path_, kMaxLineBytes);
    if (!lines.ok()) return lines.status();
    lines_ = *std::move(lines);
    // The distance of the first lines is the rate of the file.
    std::vector<std::int64_t> times_us;
    for (int i = 0; i < 3; ++i) {
      Frame frame;
      absl::StatusOr<bool> more = read(frame);
      if (!more.ok()) return more.status();
      if (!*more) break;
      times_us.push_back(frame.time_us);
      ahead_.push_back(std::move(frame));
    }
    if (ahead_.empty()) return fault(path_, "there are no lines with positions in the file");
    info_.fps = regular_fps(times_us);
    if (options.source_fps && times_us.size() > 1) {
      absl::StatusOr<double> fps = resolve_fps(path_, info_.fps, options, "");
      if (!fps.ok()) return fps.status();
    }
    return absl::OkStatus();
  }

  const Info& info() const override { return info_; }

  absl::StatusOr<bool> next(Frame& frame) override {
    if (ahead_.empty()) return read(frame);
    frame = std::move(ahead_.front());
    ahead_.pop_front();
    return true;
  }

 private:
  absl::StatusOr<bool> read(Frame& frame) {
    std::string_view line;
    do {
      absl::StatusOr<bool> more = lines_->next(line);
      if (!more.ok()) return more.status();
      if (!*more) return false;
      line = trimmed(line);
    } while (line.empty());
    const std::uint64_t number = lines_->number();
    const std::string_view rest_of_cut =
        lines_->unterminated() ? "; the file is cut short: remove its last line" : "";

    const std::size_t blank = std::min(line.find(' '), line.size());
    double time_s = 0.0;
    if (!parse_number(line.substr(0, blank), time_s) || !(std::abs(time_s) <= kMaxTimeS)) {
      return fault(
          path_, number,
          absl::StrCat("time is ", quoted(line.substr(0, blank)), ", must be a number of seconds"));
    }
    const std::int64_t time_us = std::llround(time_s * 1e6);
    if (!started_) first_us_ = time_us;
    if (started_ && time_us - first_us_ <= last_us_) {
      return fault(path_, number,
                   absl::StrCat("time is ", number_text(time_s),
                                " s, must be later than in the line before"));
    }
    clear_frame(Columns{}, time_us - first_us_, frame);
    std::size_t at = blank;
    while (true) {
      while (at < line.size() && (line[at] == ' ' || line[at] == '\t')) ++at;
      if (at >= line.size()) break;
      const std::size_t end = line.find(')', at);
      const std::size_t comma = line.find(',', at);
      double x = 0.0, y = 0.0;
      if (line[at] != '(' || end == std::string_view::npos || comma > end ||
          !parse_number(trimmed(line.substr(at + 1, comma - at - 1)), x) ||
          !parse_number(trimmed(line.substr(comma + 1, end - comma - 1)), y)) {
        return fault(
            path_, number,
            absl::StrCat("position of agent ", frame.ids.size(), " is ",
                         quoted(line.substr(at, 40)), ", must be (x,y)", std::string(rest_of_cut)));
      }
      x *= unit_m_;
      y *= unit_m_;
      if (absl::Status s = check_position(path_, number, 'x', x); !s.ok()) return s;
      if (absl::Status s = check_position(path_, number, 'y', y); !s.ok()) return s;
      if (frame.ids.size() >= kMaxAgentsPerFrame) {
        return fault(path_, number, absl::StrCat("more than ", kMaxAgentsPerFrame, " agents"));
      }
      frame.ids.push_back(frame.ids.size());
      frame.x_m.push_back(x);
      frame.y_m.push_back(y);
      at = end + 1;
    }
    // Agents are known by their order only: with one less nobody could tell who left.
    if (started_ && frame.ids.size() != agents_) {
      return fault(path_, number,
                   absl::StrCat("the line has ", frame.ids.size(), " agents, the first ", agents_,
                                std::string(rest_of_cut)));
    }
    agents_ = frame.ids.size();
    started_ = true;
    last_us_ = frame.time_us;
    return true;
  }

  std::string path_;
  Info info_;
  std::unique_ptr<LineSource> lines_;
  std::deque<Frame> ahead_;
  double unit_m_ = 1.0;
  bool started_ = false;
  std::size_t agents_ = 0;
  std::int64_t first_us_ = 0, last_us_ = 0;
};

}  // namespace

ReaderOr open_rvo2_text(const std::string& path, const ReadOptions& options) {
  auto reader = std::make_unique<Rvo2Reader>(path);
  if (absl::Status status = reader->open(options); !status.ok()) return status;
  return std::unique_ptr<Reader>(std::move(reader));
}

}  // namespace throng::trajectory::detail
