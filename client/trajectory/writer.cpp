#include "throng/trajectory/writer.hpp"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "support.hpp"
#include "writers.hpp"

namespace throng::trajectory {
namespace {

using detail::fault;
using detail::number_text;

/// What a format is, and what it can hold of a crowd besides who is where.
struct Format {
  const char* name;    // as readers call it
  const char* called;  // in messages
  std::vector<const char*> endings;
  detail::WriterOr (*write)(const std::string&, const WriteSpec&);
  bool text;      // may be gzipped
  bool numbered;  // counts frames at a rate
  bool z, heading, area;
  const char* channels;      // "*": all; else the one it has a place for, "" none
  bool names;                // ids may be names
  std::uint64_t largest_id;  // of numbers
  // Channels of these names would be read as something else.
  std::vector<const char*> reserved;
};

const std::vector<Format>& formats() {
  using namespace detail;
  constexpr std::uint64_t kAny = std::numeric_limits<std::uint64_t>::max();
  static const std::vector<Format> kFormats = {
      {"csv",
       "CSV",
       {".csv"},
       write_csv,
       true,
       false,
       true,
       true,
       false,
       "*",
       true,
       kAny,
       {"motion", "character"}},
      {"jupedsim-sqlite",
       "JuPedSim's SQLite",
       {".sqlite", ".db"},
       write_jupedsim_sqlite,
       false,
       true,
       false,
       true,
       true,
       "",
       false,
       kLargestExactId,
       {}},
      {"jupedsim-hdf5",
       "JuPedSim's HDF5",
       {".h5", ".hdf5"},
       write_hdf5,
       false,
       true,
       true,
       true,
       true,
       "",
       false,
       kLargestHdf5Id,
       {}},
      {"archive-text",
       "archive text",
       {".txt"},
       write_archive_text,
       true,
       true,
       true,
       true,
       false,
       "*",
       false,
       kLargestExactId,
       {}},
      {"vadere-traj",
       "Vadere's .traj",
       {".traj"},
       write_vadere,
       true,
       false,
       false,
       false,
       false,
       "*",
       false,
       kLargestVadereId,
       {"id", "pedestrianId", "time", "simTime", "startTime", "endTime", "startX", "startY", "endX",
        "endY"}},
      {"sumo-fcd",
       "SUMO's floating-car data",
       {".xml"},
       write_sumo_fcd,
       true,
       false,
       true,
       true,
       false,
       "speed",
       true,
       kAny,
       {}},
      {"menge-scb",
       "Menge's SCB",
       {".scb"},
       write_menge_scb,
       false,
       true,
       true,
       true,
       false,
       "class",
       false,
       kAny,
       {}},
      {"trajnet-ndjson",
       "TrajNet++",
       {".ndjson"},
       write_trajnet,
       true,
       true,
       false,
       false,
       false,
       "",
       false,
       kLargestExactId,
       {}},
      {"obsmat",
       "obsmat",
       {},
       write_obsmat,
       true,
       true,
       false,
       false,
       false,
       "",
       false,
       kLargestExactId,
       {}},
  };
  return kFormats;
}

absl::StatusOr<const Format*> write_format(const std::string& path, const std::string& name) {
  const bool gzip = absl::EndsWithIgnoreCase(path, ".gz");
  const std::string bare = gzip ? path.substr(0, path.size() - 3) : path;
  for (const Format& format : formats()) {
    const bool ending =
        std::any_of(format.endings.begin(), format.endings.end(),
                    [&](const char* end) { return absl::EndsWithIgnoreCase(bare, end); });
    if (name.empty() ? !ending : name != format.name) continue;
    if (!gzip || format.text) return &format;
    return fault(path, absl::StrCat(format.called, " is not written inside gzip; leave .gz out"));
  }
  const std::string names = absl::StrJoin(write_format_names(), ", ");
  if (!name.empty()) {
    return fault(path, absl::StrCat("format to write is ", detail::quoted(name),
                                    ", must be one of ", names));
  }
  std::vector<std::string> endings;
  for (const Format& format : formats())
    endings.insert(endings.end(), format.endings.begin(), format.endings.end());
  return fault(path, absl::StrCat("the ending tells no format to write; end it with ",
                                  absl::StrJoin(endings, ", "), ", or name one of ", names));
}

absl::StatusOr<std::unique_ptr<Writer>> make(const Format& format, const std::string& path,
                                             const WriteSpec& spec) {
  if (format.numbered && !detail::valid_fps(spec.fps)) {
    return fault(path, absl::StrCat("frame rate to write is ", number_text(spec.fps),
                                    ", must be between 0.0001 and 100000; times may be irregular: "
                                    "write CSV or give a rate"));
  }
  return format.write(path, spec);
}

/// Names of channels that would be read as something else get an end; one note for each.
void rename_channels(const Format& format, std::vector<std::string>& channels,
                     std::vector<std::string>& notes) {
  for (std::string& name : channels) {
    const bool taken = std::any_of(
        format.reserved.begin(), format.reserved.end(),
        [&](const char* reserved) { return detail::lower(name) == detail::lower(reserved); });
    if (!taken) continue;
    notes.push_back(absl::StrCat("the channel '", name, "' is written as '", name, "_value'"));
    name += "_value";
  }
}

/// What a format will lose of a crowd, a line for each kind of thing.
void note_losses(const Format& format, const WriteSpec& spec, bool renumber,
                 std::vector<std::string>& notes, const Summary& summary) {
  std::vector<std::string> lost;
  const std::string kept = format.channels;
  const auto& channels = spec.channel_names;
  if (spec.has_z && !format.z) lost.push_back("heights");
  if (spec.has_heading && !format.heading) lost.push_back("headings");
  if (kept != "*" && std::any_of(channels.begin(), channels.end(),
                                 [&](const std::string& name) { return name != kept; })) {
    lost.push_back(kept.empty() ? "channels" : "channels but " + kept);
  }
  if (!lost.empty()) {
    notes.push_back(absl::StrCat(format.called, " holds no ", absl::StrJoin(lost, " and no "),
                                 "; they are not written"));
  }
  const std::string name = format.name;
  if (name != "csv" && (summary.has_motion || summary.has_characters)) {
    notes.push_back(
        "what agents do and who they were chosen to be is not written; only CSV holds it");
  }
  if (!format.area && !spec.walkable_area_wkt.empty()) {
    notes.push_back("the walkable area is not written; only JuPedSim's SQLite and HDF5 hold it");
  }
  if (renumber) {
    notes.push_back(
        absl::StrCat("ids become 1, 2, ... in order of appearance: the format has no "
                     "names and no numbers above ",
                     format.largest_id));
  }
  if (name == "obsmat" && !detail::same_rate(spec.fps, 2.5)) {
    notes.push_back(
        absl::StrCat("obsmat says no rate and is read as 2.5 samples a second; read "
                     "this one with --source-fps ",
                     number_text(spec.fps)));
  }
  if (name == "vadere-traj" && detail::valid_fps(spec.fps) && !detail::same_rate(spec.fps, 10.0)) {
    notes.push_back(
        absl::StrCat("footsteps have no rate and are read at 10 frames a second; "
                     "--source-fps ",
                     number_text(spec.fps), " meets the samples"));
  }
  if (name == "menge-scb") {
    const double farthest_m =
        std::max({std::abs(summary.min_x_m), std::abs(summary.max_x_m), std::abs(summary.min_y_m),
                  std::abs(summary.max_y_m), std::abs(summary.min_z_m), std::abs(summary.max_z_m)});
    const float single = static_cast<float>(farthest_m);
    const float step_m = std::nextafter(single, std::numeric_limits<float>::infinity()) - single;
    notes.push_back(
        absl::StrCat("agents become 0, 1, ... as the first frame lists them; positions are in "
                     "single precision, here in steps of up to ",
                     number_text(std::ceil(1e6 * static_cast<double>(step_m)) * 1e-3), " mm"));
    if (!spec.has_heading) notes.push_back("headings are not known and are written as NaN");
  }
}

}  // namespace

std::vector<std::string> write_format_names() {
  std::vector<std::string> names;
  for (const Format& format : formats()) names.emplace_back(format.name);
  return names;
}

absl::StatusOr<std::unique_ptr<Writer>> make_writer(const std::string& path,
                                                    const WriteSpec& spec) {
  const absl::StatusOr<const Format*> format = write_format(path, spec.format);
  if (!format.ok()) return format.status();
  return make(**format, path, spec);
}

absl::StatusOr<Summary> convert(const std::string& input, const std::string& output,
                                const ReadOptions& options, const std::string& format, double fps,
                                const std::function<bool(std::uint64_t, std::uint64_t)>& goes_on) {
  const absl::StatusOr<const Format*> written = write_format(output, format);
  if (!written.ok()) return written.status();
  const Format& kind = **written;
  absl::StatusOr<Summary> summary = summarize(input, options);
  if (!summary.ok()) return summary;
  WriteSpec spec;
  spec.format = kind.name;
  spec.fps = fps > 0.0 ? fps : summary->info.fps;
  spec.has_z = summary->has_z;
  spec.has_heading = summary->has_heading;
  spec.channel_names = summary->info.channel_names;
  // others read WKT only: the surfaces that may follow stay out
  spec.walkable_area_wkt =
      summary->info.walkable_area_wkt.substr(0, summary->info.walkable_area_wkt.find("\n;"));
  spec.min_x_m = summary->min_x_m;
  spec.max_x_m = summary->max_x_m;
  spec.min_y_m = summary->min_y_m;
  spec.max_y_m = summary->max_y_m;
  const bool csv = spec.format == "csv";
  if (csv && summary->has_motion) spec.motion_names = summary->info.motion_names;
  spec.has_characters = csv && summary->has_characters;
  const bool renumber = summary->largest_id > kind.largest_id;
  rename_channels(kind, spec.channel_names, summary->info.notes);
  note_losses(kind, spec, renumber, summary->info.notes, *summary);

  absl::StatusOr<std::unique_ptr<Reader>> reader = open(input, options);
  if (!reader.ok()) return reader.status();
  absl::StatusOr<std::unique_ptr<Writer>> writer = make(kind, output, spec);
  if (!writer.ok()) return writer.status();
  std::unordered_map<std::uint64_t, std::uint64_t> numbers;
  std::vector<std::string> names;
  std::vector<std::int32_t> characters;
  std::uint64_t frames = 0;
  Frame frame;
  while (true) {
    absl::StatusOr<bool> more = (*reader)->next(frame);
    if (!more.ok()) return more.status();
    if (!*more) break;
    names.clear();
    characters.clear();
    for (std::uint64_t& id : frame.ids) {
      if (spec.has_characters) characters.push_back((*reader)->agent_character(id));
      if (renumber) {
        id = numbers.try_emplace(id, numbers.size() + 1).first->second;
      } else if (kind.names) {
        names.push_back((*reader)->agent_name(id));
      }
    }
    if (absl::Status s = (*writer)->write(frame, names, characters); !s.ok()) return s;
    if (goes_on && !goes_on(++frames, summary->frames)) {
      return absl::CancelledError(absl::StrCat(output, ": stopped after ", frames, " frames"));
    }
  }
  if (absl::Status s = (*writer)->close(); !s.ok()) return s;
  for (std::string& note : (*writer)->notes()) summary->info.notes.push_back(std::move(note));
  return summary;
}

}  // namespace throng::trajectory
