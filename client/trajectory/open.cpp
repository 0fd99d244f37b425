#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstring>
#include <fstream>

#include "csv_split.hpp"
#include "readers.hpp"
#include "recording_format.hpp"
#include "support.hpp"
#include "text_source.hpp"
#include "throng/trajectory/trajectory.hpp"

namespace throng::trajectory {
namespace {

using detail::ByteSource;
using detail::fault;
using detail::lower;
using detail::parse_number;
using detail::split_blanks;
using detail::trimmed;

/// What a file's first bytes look like is decided on this many of them (unpacked).
constexpr std::size_t kSniffBytes = 1u << 16;

constexpr const char* kRead =
    "read are JuPedSim (sqlite, HDF5, text), CSV with columns time_s or frame, id, x_m, y_m, "
    "Vadere "
    ".traj, SUMO floating-car data, Menge .scb, TrajNet++ ndjson, ETH obsmat, RVO2 text and "
    "recordings of throng-server; --format names one";

bool starts_with(std::string_view text, std::string_view start) {
  return text.substr(0, start.size()) == start;
}

/// Name of an XML document's root element, empty where it is not among the first bytes.
std::string_view root_of(std::string_view text) {
  while (true) {
    const std::size_t open = text.find('<');
    if (open == std::string_view::npos || open + 1 == text.size()) return {};
    text.remove_prefix(open + 1);
    if (text.front() == '!' || text.front() == '?') {
      const std::string_view ends = starts_with(text, "!--") ? "-->" : ">";
      const std::size_t end = text.find(ends);
      if (end == std::string_view::npos) return {};
      text.remove_prefix(end + ends.size());
      continue;
    }
    return text.substr(0, text.find_first_of(" \t\r\n/>"));
  }
}

/// A sentence rather than the names of columns.
bool is_prose(std::string_view line, char delimiter) {
  constexpr std::size_t kMostWords = 5;
  std::vector<std::string_view> words;
  while (true) {
    const std::size_t end = line.find(delimiter);
    split_blanks(line.substr(0, end), words);
    if (words.size() > kMostWords) return true;
    if (end == std::string_view::npos) return false;
    line.remove_prefix(end + 1);
  }
}

/// Whether fields are eight numbers of which those for height and its speed are zero.
bool looks_like_obsmat(const std::vector<std::string_view>& fields) {
  if (fields.size() != 8) return false;
  double values[8];
  for (std::size_t i = 0; i < 8; ++i) {
    if (!parse_number(fields[i], values[i])) return false;
  }
  return values[3] == 0.0 && values[6] == 0.0;
}

absl::StatusOr<std::string> format_of_text(const std::string& path, std::string_view text) {
  if (starts_with(text, "\xEF\xBB\xBF")) text.remove_prefix(3);
  const std::string_view body = trimmed(text);
  if (body.empty()) return fault(path, "the file has only blanks");
  if (body.front() == '<') {
    if (absl::StrContains(absl::string_view(body.data(), body.size()), "<trajectories")) {
      return fault(path, "old JuPedSim XML trajectories are not read; write text or SQLite");
    }
    if (root_of(body) == "net") {
      return fault(path,
                   "this is SUMO's network: streets, and nobody who walks; give it with "
                   "--net, and as trajectories what 'sumo --fcd-output' writes");
    }
    return std::string("sumo-fcd");
  }
  if (body.front() == '{') return std::string("trajnet-ndjson");
  if (starts_with(body, "version ")) {
    return fault(path, "this is PeTrack's internal .trc in pixels; export it as .txt or .h5");
  }
  if (starts_with(body, "$VISION")) {
    return fault(path, "Viswalk .pp is not read; write a table with time_s,id,x_m,y_m");
  }

  // The first line that is no comment tells; the comments before it may help.
  std::string_view first;
  bool vadere = false, rows_of_obsmat = true;
  std::size_t rows = 0;
  std::vector<std::string_view> fields;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    if (end == std::string_view::npos && rows > 0) break;  // perhaps half a line
    const std::string_view line = trimmed(text.substr(0, end));
    text = end == std::string_view::npos ? std::string_view() : text.substr(end + 1);
    if (line.empty()) continue;
    if (line.front() == '#') {
      vadere = vadere || starts_with(line, "#IDXCOL");
      rows_of_obsmat = false;
      continue;
    }
    if (rows == 0) first = line;
    split_blanks(line, fields);
    rows_of_obsmat = rows_of_obsmat && looks_like_obsmat(fields);
    if (++rows == 64) break;
  }
  if (rows == 0) return std::string("archive-text");  // only a header: its reader says what lacks
  const std::string words = lower(first);
  split_blanks(words, fields);
  bool ids = false, steps = false;
  for (const std::string_view field : fields) {
    ids = ids || starts_with(field, "pedestrianid") || field == "id";
    steps = steps || starts_with(field, "endtime") || starts_with(field, "endx");
  }
  if (ids && (vadere || steps)) return std::string("vadere-traj");
  if (rows_of_obsmat) return std::string("obsmat");

  double number = 0.0;
  if (fields.size() > 1 && parse_number(fields[0], number) && fields[1].front() == '(') {
    return std::string("rvo2-text");
  }
  const char delimiter = detail::csv_delimiter(first);
  if (delimiter == ';' || delimiter == ',') {
    if (is_prose(first, delimiter)) {
      return fault(path, absl::StrCat("this is text, no trajectories: its first row is ",
                                      detail::quoted(first), "; ", kRead));
    }
    return std::string("csv");
  }
  // Rows of numbers between blanks or tabs; a word in the first field is a column's name.
  if (!fields.empty() && parse_number(fields[0], number)) return std::string("archive-text");
  bool positions = false;
  for (const std::string_view field : fields) {
    positions = positions || starts_with(field, "x") || starts_with(field, "pos");
  }
  if (positions) return std::string("csv");
  return fault(path, absl::StrCat("the format is not known: the first row is ",
                                  detail::quoted(first), "; ", kRead));
}

bool is_gzip(const std::string& path) {
  char magic[2] = {};
  std::ifstream file(path, std::ios::binary);
  return file.read(magic, 2) && magic[0] == '\x1f' && magic[1] == '\x8b';
}

absl::StatusOr<std::string> format_of(const std::string& path) {
  absl::StatusOr<std::unique_ptr<ByteSource>> source = ByteSource::open(path);
  if (!source.ok()) return source.status();
  std::string head(kSniffBytes, '\0');
  std::size_t filled = 0;
  while (filled < head.size()) {
    absl::StatusOr<std::size_t> got = (*source)->read(head.data() + filled, head.size() - filled);
    // A damaged end is the reader's to report, where the rows before it are known.
    if (!got.ok() && filled == 0) return got.status();
    if (!got.ok() || *got == 0) break;
    filled += *got;
  }
  head.resize(filled);
  if (head.empty()) return fault(path, "the file is empty");
  if (starts_with(head, std::string_view("SQLite format 3\0", 16)))
    return std::string("jupedsim-sqlite");
  if (starts_with(head, "\x89HDF\r\n\x1a\n")) return std::string("jupedsim-hdf5");
  if (starts_with(head, detail::kRecordingMagic)) return std::string("throng-recording");
  if (starts_with(head, "PAR1")) {
    return fault(path, "Parquet is not read; write SUMO's output as .xml, .xml.gz or .csv");
  }
  if (starts_with(head, std::string_view("PK\3\4", 4))) {
    return fault(path, "this is a zip archive; unpack it first");
  }
  if (head.size() >= 4 && head[0] >= '0' && head[0] <= '9' && head[1] == '.' && head[2] >= '0' &&
      head[2] <= '9' && head[3] == '\0') {
    return std::string("menge-scb");
  }
  if (head.find('\0') != std::string::npos) {
    return fault(path, absl::StrCat("binary data of a kind that is not known; ", kRead));
  }
  return format_of_text(path, head);
}

}  // namespace

std::vector<std::string> format_names() {
  return {"jupedsim-sqlite", "archive-text",   "jpscore-text", "obsmat",        "csv",
          "pathfinder-csv",  "crowdit-csv",    "sumo-fcd-csv", "vadere-traj",   "sumo-fcd",
          "menge-scb",       "trajnet-ndjson", "rvo2-text",    "jupedsim-hdf5", "throng-recording"};
}

absl::StatusOr<std::unique_ptr<Reader>> open(const std::string& path, const ReadOptions& options) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) {
    const std::string message = absl::StrCat(path, ": ", std::strerror(errno));
    if (errno == ENOENT || errno == ENOTDIR) return absl::NotFoundError(message);
    return absl::PermissionDeniedError(message);
  }
  if (!S_ISREG(status.st_mode)) return fault(path, "this is not a regular file");

  std::string format = options.format;
  if (format.empty()) {
    absl::StatusOr<std::string> found = format_of(path);
    if (!found.ok()) return found.status();
    format = *std::move(found);
  }
  const bool binary = format == "jupedsim-sqlite" || format == "menge-scb" ||
                      format == "jupedsim-hdf5" || format == "throng-recording";
  if (binary && is_gzip(path)) {
    return fault(path, absl::StrCat("this is ", format, " inside gzip; unpack it first (gunzip)"));
  }
  if (format == "jupedsim-sqlite") return detail::open_jupedsim_sqlite(path, options);
  if (format == "archive-text" || format == "jpscore-text" || format == "obsmat") {
    return detail::open_archive_text(path, options, format);
  }
  if (format == "csv" || absl::EndsWith(format, "-csv")) return detail::open_csv(path, options);
  if (format == "vadere-traj") return detail::open_vadere(path, options);
  if (format == "sumo-fcd") return detail::open_sumo_fcd(path, options);
  if (format == "trajnet-ndjson") return detail::open_trajnet(path, options);
  if (format == "rvo2-text") return detail::open_rvo2_text(path, options);
  if (format == "menge-scb") return detail::open_menge_scb(path, options);
  if (format == "jupedsim-hdf5") return detail::open_hdf5(path, options);
  if (format == "throng-recording") return detail::open_recording(path, options);
  return fault(path, absl::StrCat("format is ", detail::quoted(format), ", must be one of ",
                                  absl::StrJoin(format_names(), ", ")));
}

}  // namespace throng::trajectory
