#include <absl/strings/str_cat.h>
#include <expat.h>

#include <cmath>
#include <cstring>
#include <deque>
#include <limits>
#include <unordered_set>

#include "readers.hpp"
#include "sorted_reader.hpp"
#include "text_source.hpp"

/// SUMO's floating car data, XML, plain or gzipped, step by step: of a file of any size only one
/// block of text, its steps and one name per person are in memory.
namespace throng::trajectory::detail {
namespace {

constexpr int kBlockBytes = 1 << 16;
/// Comments and tags longer than this are not SUMO's; its settings comment has a few kilobytes.
constexpr XML_Index kMaxTokenBytes = 16 << 20;
constexpr std::size_t kRateSteps = 3;  // read ahead to learn the rate

struct FreeParser {
  void operator()(XML_Parser parser) const { XML_ParserFree(parser); }
};

class FcdReader final : public Reader {
 public:
  explicit FcdReader(std::string path)
      : path_(std::move(path)), parser_(XML_ParserCreate(nullptr)), block_(kBlockBytes) {
    info_.format = "sumo-fcd";
  }

  absl::Status open(const ReadOptions& options) {
    if (absl::Status s = require_metres(path_, options, "SUMO"); !s.ok()) return s;
    if (parser_ == nullptr) return absl::ResourceExhaustedError(absl::StrCat(path_, ": no memory"));
    absl::StatusOr<std::unique_ptr<ByteSource>> bytes = ByteSource::open(path_);
    if (!bytes.ok()) return bytes.status();
    bytes_ = *std::move(bytes);
    XML_SetUserData(parser_.get(), this);
    XML_SetElementHandler(parser_.get(), &FcdReader::on_start, &FcdReader::on_end);
    XML_SetEntityDeclHandler(parser_.get(), &FcdReader::on_entity);

    // The rate, and whether there are speeds, are told by the first steps.
    while (ready_.size() < kRateSteps && !at_end_ && status_.ok()) feed();
    if (!status_.ok() && ready_.empty()) return status_;
    if (status_.ok() && ready_.empty()) {
      return fault(path_, "there are no time steps in the file; run SUMO with --fcd-output");
    }
    std::vector<std::int64_t> times_us;
    for (const Frame& frame : ready_) times_us.push_back(frame.time_us);
    info_.fps = regular_fps(times_us);
    if (options.source_fps) {
      std::optional<double> of_file;
      if (info_.fps > 0.0) of_file = info_.fps;
      absl::StatusOr<double> fps = resolve_fps(path_, of_file, options, "");
      if (!fps.ok()) return fps.status();
    }
    // A file whose people all lack a speed gets no channel for it.
    has_speed_ = speed_seen_ || persons_ == 0;
    if (has_speed_) info_.channel_names.push_back("speed");
    if (degrees_like_ > 0 && degrees_like_ == persons_) {
      info_.notes.push_back(
          "positions look like longitude and latitude; run SUMO without "
          "--fcd-output.geo");
    }
    if (vehicles_ > 0) info_.notes.push_back("vehicles are skipped");
    return absl::OkStatus();
  }

  const Info& info() const override { return info_; }
  std::string agent_name(std::uint64_t id) const override { return ids_.name(id); }

  absl::StatusOr<bool> next(Frame& frame) override {
    while (ready_.empty() && !at_end_ && status_.ok()) feed();
    if (ready_.empty()) {
      if (!status_.ok()) return status_;
      if (!counted_) count();
      return false;
    }
    frame = std::move(ready_.front());
    ready_.pop_front();
    frame.channels.resize(has_speed_ ? 1 : 0);
    return true;
  }

 private:
  /// Parses one more block; whole time steps in it become frames.
  void feed() {
    absl::StatusOr<std::size_t> got = bytes_->read(block_.data(), block_.size());
    if (!got.ok()) {
      status_ = got.status();
      return;
    }
    at_end_ = *got == 0;
    const XML_Status parsed =
        XML_Parse(parser_.get(), block_.data(), static_cast<int>(*got), at_end_ ? 1 : 0);
    fed_ += static_cast<XML_Index>(*got);
    if (!status_.ok()) return;  // a handler stopped it
    if (parsed == XML_STATUS_ERROR) {
      const XML_Error error = XML_GetErrorCode(parser_.get());
      const bool cut = at_end_;
      fail(absl::StrCat("the XML is not well-formed (", XML_ErrorString(error), ")",
                        cut ? "; the file is cut short: SUMO may still be running or was stopped"
                            : "; write the file again"));
      return;
    }
    if (!at_end_ && fed_ - XML_GetCurrentByteIndex(parser_.get()) > kMaxTokenBytes) {
      fail(absl::StrCat("a tag or comment is longer than ", kMaxTokenBytes, " bytes"));
    }
  }

  void fail(std::string_view message) {
    if (!status_.ok()) return;
    status_ = fault(path_, XML_GetCurrentLineNumber(parser_.get()), message);
    XML_StopParser(parser_.get(), XML_FALSE);
  }

  static const char* attribute(const XML_Char** attributes, const char* name) {
    for (; attributes[0] != nullptr; attributes += 2) {
      if (std::strcmp(attributes[0], name) == 0) return attributes[1];
    }
    return nullptr;
  }

  static void XMLCALL on_entity(void* self, const XML_Char*, int, const XML_Char*, int,
                                const XML_Char*, const XML_Char*, const XML_Char*,
                                const XML_Char*) {
    static_cast<FcdReader*>(self)->fail("the file declares XML entities, which are not read");
  }

  static void XMLCALL on_start(void* self, const XML_Char* name, const XML_Char** attributes) {
    static_cast<FcdReader*>(self)->start(name, attributes);
  }
  static void XMLCALL on_end(void* self, const XML_Char* name) {
    static_cast<FcdReader*>(self)->end(name);
  }

  void start(std::string_view name, const XML_Char** attributes) {
    if (!status_.ok()) return;
    ++depth_;
    if (depth_ == 1) {
      if (name == "fcd-export" || name == "person-fcd-export") return;
      fail(absl::StrCat("the root element is ", quoted(name),
                        ", must be 'fcd-export' as 'sumo --fcd-output' writes it"));
    } else if (depth_ == 2 && name == "timestep") {
      start_step(attribute(attributes, "time"));
    } else if (in_step_ && name == "vehicle") {
      ++vehicles_;
    } else if (in_step_ && depth_ == 3 && name == "person") {
      add_person(attributes);
    } else if (in_step_ && name == "person") {
      ++riders_;  // inside a vehicle: nobody sees them walk
    }
  }

  void end(std::string_view name) {
    if (!status_.ok()) return;
    if (depth_ == 2 && in_step_) {
      in_step_ = false;
      ready_.push_back(std::move(step_));
      step_ = Frame();
    }
    --depth_;
  }

  void start_step(const char* text) {
    double time_s = 0.0;
    if (text == nullptr || !parse_number(trimmed(text), time_s) ||
        !(std::abs(time_s) <= kMaxTimeS)) {
      const bool clock = text != nullptr && std::strchr(text, ':') != nullptr;
      fail(absl::StrCat("time of the timestep is ", quoted(text != nullptr ? text : ""),
                        ", must be a number of seconds",
                        clock ? "; run SUMO without --human-readable-time" : ""));
      return;
    }
    const std::int64_t time_us = std::llround(time_s * 1e6);
    if (!started_) first_us_ = time_us;
    if (started_ && time_us <= last_us_) {
      fail(absl::StrCat("time of the timestep is ", number_text(time_s),
                        " s, must be later than the one before"));
      return;
    }
    started_ = true;
    last_us_ = time_us;
    in_step_ = true;
    seen_.clear();
    step_.time_us = time_us - first_us_;
    step_.channels.resize(1);
  }

  /// A number attribute. False: reported as an error, or absent (`value` is NaN then).
  bool number(const XML_Char** attributes, const char* name, bool required, double& value) {
    const char* text = attribute(attributes, name);
    value = std::numeric_limits<double>::quiet_NaN();
    if (text == nullptr && !required) return true;
    if (text != nullptr && parse_number(trimmed(text), value)) return true;
    const char* id = attribute(attributes, "id");
    fail(absl::StrCat(name, " of person ", quoted(id != nullptr ? id : ""), " is ",
                      quoted(text != nullptr ? text : ""), ", must be a number"));
    return false;
  }

  void add_person(const XML_Char** attributes) {
    const char* name = attribute(attributes, "id");
    absl::StatusOr<std::uint64_t> id = ids_.id(name != nullptr ? name : "");
    if (!id.ok()) {
      fail(absl::StrCat("person: ", id.status().message()));
      return;
    }
    if (!seen_.insert(*id).second) {
      fail(absl::StrCat("person ", quoted(name), " is there twice in the timestep"));
      return;
    }
    if (seen_.size() > kMaxAgentsPerFrame) {
      fail(absl::StrCat("more than ", kMaxAgentsPerFrame, " persons in one timestep"));
      return;
    }
    double x = 0.0, y = 0.0, z = 0.0, angle_deg = 0.0, speed = 0.0;
    if (!number(attributes, "x", true, x) || !number(attributes, "y", true, y) ||
        !number(attributes, "z", false, z) || !number(attributes, "angle", false, angle_deg) ||
        !number(attributes, "speed", false, speed)) {
      return;
    }
    const bool has_z = attribute(attributes, "z") != nullptr;
    for (const auto& [value, axis] :
         {std::pair(x, 'x'), std::pair(y, 'y'), std::pair(has_z ? z : 0.0, 'z')}) {
      if (std::isfinite(value) && std::abs(value) <= kMaxPositionM) continue;
      fail(absl::StrCat(std::string(1, axis), " of person ", quoted(name), " is ",
                        number_text(value), " m, must be a number between -1e8 and 1e8 m"));
      return;
    }
    step_.ids.push_back(*id);
    step_.x_m.push_back(x);
    step_.y_m.push_back(y);
    // Heights and angles come with the first person that has one.
    if (has_z) step_.z_m.resize(step_.ids.size() - 1, 0.0);
    if (!step_.z_m.empty() || has_z) step_.z_m.push_back(has_z ? z : 0.0);
    // Clockwise from north to counter-clockwise from east.
    step_.heading_rad.push_back(
        static_cast<float>(std::remainder(90.0 - angle_deg, 360.0) * kPi / 180.0));
    const bool speed_known = std::abs(speed) <= 3e38;
    step_.channels[0].push_back(speed_known ? static_cast<float>(speed)
                                            : std::numeric_limits<float>::quiet_NaN());
    speed_seen_ = speed_seen_ || speed_known;
    ++persons_;
    const char* digits = std::strchr(attribute(attributes, "x"), '.');
    if (std::abs(x) <= 180.0 && std::abs(y) <= 90.0 && digits != nullptr &&
        std::strlen(digits) > 5) {
      ++degrees_like_;
    }
  }

  void count() {
    counted_ = true;
    std::erase(info_.notes, "vehicles are skipped");
    if (vehicles_ > 0) {
      info_.notes.push_back(
          absl::StrCat(counted(vehicles_, "sample", "samples"), " of vehicles skipped"));
    }
    if (riders_ > 0) {
      info_.notes.push_back(absl::StrCat(counted(riders_, "sample", "samples"),
                                         " of persons inside vehicles skipped"));
    }
  }

  std::string path_;
  Info info_;
  std::unique_ptr<ByteSource> bytes_;
  std::unique_ptr<std::remove_pointer_t<XML_Parser>, FreeParser> parser_;
  std::vector<char> block_;
  XML_Index fed_ = 0;
  bool at_end_ = false;
  absl::Status status_;  // the first error; frames before it are still given

  int depth_ = 0;
  bool in_step_ = false, started_ = false;
  std::int64_t first_us_ = 0, last_us_ = 0;
  Frame step_;
  std::unordered_set<std::uint64_t> seen_;  // of this step
  std::deque<Frame> ready_;
  IdTable ids_{true};  // names, also when they look like numbers: SUMO's ids are strings
  bool has_speed_ = true, speed_seen_ = false, counted_ = false;
  std::uint64_t persons_ = 0, vehicles_ = 0, riders_ = 0, degrees_like_ = 0;
};

}  // namespace

ReaderOr open_sumo_fcd(const std::string& path, const ReadOptions& options) {
  auto reader = std::make_unique<FcdReader>(path);
  if (absl::Status status = reader->open(options); !status.ok()) return status;
  return std::unique_ptr<Reader>(std::move(reader));
}

}  // namespace throng::trajectory::detail
