#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "simplify/report/measure.hpp"

namespace throng::simplify {

/// A baked character on disk, and what its cast knows of it.
struct BakedFile {
  std::string name, path;
  double bake_s = -1.0;                                     // negative: not known
  std::optional<std::vector<std::uint32_t>> pose_frames{};  // as CastEntry's
};

/// The files of casts (folders with cast.json) and .throng files, in the order given.
/// @param names  only these characters; empty: all
/// NotFound or InvalidArgument names what isn't there or is broken; NotFound where none is left.
absl::StatusOr<std::vector<BakedFile>> find_baked(const std::vector<std::string>& inputs,
                                                  const std::vector<std::string>& names = {});

struct ReportOptions {
  std::vector<std::string> inputs;      // folders of casts, .throng files
  std::vector<std::string> characters;  // only these names; empty: all
  std::string folder;
  std::string python;  // interpreter with the package meshoptimizer, empty: don't ask for it
  unsigned jobs = 1;
  MeasureOptions measure;
  std::string peng2011;  // built-in character for the pictures of Peng et al. 2011; empty: none
  /// A line for the user. Called from several threads, one at a time.
  std::function<void(const std::string&)> say;
  /// 0 to 1; as `say`.
  std::function<void(float)> on_progress;
};

struct ReportResult {
  std::vector<CharacterReport> characters;  // the one that loses most first
  std::vector<std::string> errors;          // inputs that can't be read
  std::vector<std::string> notes;           // what the report doesn't have
  double seconds = 0.0;
};

/// Measures characters and writes a folder: index.html with its pictures, levels.csv with a line
/// for each character, level and method, summary.csv with a line for each level and method,
/// sampling.csv with what the sampling of poses costs at each level. A
/// character that can't be read is told in `errors`, the others are still reported. Errors only for
/// what stops everything: nothing to report, a folder that can't be written (Unavailable).
absl::StatusOr<ReportResult> write_report(const ReportOptions& options);

/// Over a number of characters.
struct Figures {
  double overlap = 0.0, psnr_db = 0.0, ssim = 0.0, hausdorff_percent = 0.0;
};

/// One method at one level over all characters.
struct SummaryRow {
  Method method = Method::kThrong;
  std::uint32_t level = 0;
  std::uint32_t characters = 0;
  Figures median;               // over characters, of their medians over all pictures
  Figures worst_pose;           // over characters, median of what each has in its worst pose
  Figures worst;                // of the worst character in its worst pose
  double triangle_ratio = 1.0;  // median over characters of triangles to throng's
};
std::vector<SummaryRow> summarize(const std::vector<CharacterReport>& characters);

/// throng beside a rival at one level and the same triangle counts: throng's, or the rival's for
/// those characters where it is stuck above.
struct ComparisonRow {
  Method rival = Method::kPlain;
  std::uint32_t level = 0;
  std::uint32_t characters = 0;
  std::uint32_t stuck = 0;              // of them, compared at the rival's count
  Figures throng_median, rival_median;  // as in SummaryRow
  Figures throng_worst_pose, rival_worst_pose;
  std::uint32_t no_worse = 0;  // characters where throng's median ssim is no less
};
std::vector<ComparisonRow> compare(const std::vector<CharacterReport>& characters);

std::string levels_csv(const std::vector<CharacterReport>& characters);
/// A line for each character and level below the full one, of those whose sampled poses are known.
std::string sampling_csv(const std::vector<CharacterReport>& characters);
std::string summary_csv(const std::vector<SummaryRow>& rows);
std::string comparison_csv(const std::vector<ComparisonRow>& rows);
std::string report_json(const ReportResult& result);
/// @param extra_html  put before the characters
std::string report_html(const ReportResult& result, const ReportOptions& options,
                        const std::string& extra_html);

}  // namespace throng::simplify
