#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "simplify/report/report.hpp"

namespace throng::simplify {
namespace {

double median_of(std::vector<double> values) {
  if (values.empty()) return 0.0;
  std::sort(values.begin(), values.end());
  return 0.5 * (values[(values.size() - 1) / 2] + values[values.size() / 2]);
}

double hausdorff_percent_of(const CharacterReport& character, const LevelReport& row) {
  return 100.0 * static_cast<double>(row.hausdorff_m / character.height_m);
}

/// A field of a CSV line (RFC 4180).
std::string field(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted(1, '"');
  for (const char c : text) quoted.append(c == '"' ? 2 : 1, c);
  quoted.push_back('"');
  return quoted;
}

}  // namespace

namespace {

/// Figures of many characters, to take the median of.
struct Gathered {
  std::vector<double> overlap, psnr_db, ssim, hausdorff_percent;
  void add(double overlap_of, double psnr, double ssim_of, double hausdorff) {
    overlap.push_back(overlap_of);
    psnr_db.push_back(psnr);
    ssim.push_back(ssim_of);
    hausdorff_percent.push_back(hausdorff);
  }
  void add_median(const CharacterReport& character, const LevelReport& row) {
    add(row.overlap.median, row.psnr_db.median, row.ssim.median,
        hausdorff_percent_of(character, row));
  }
  void add_worst_pose(const CharacterReport& character, const LevelReport& row) {
    add(row.overlap.worst_pose, row.psnr_db.worst_pose, row.ssim.worst_pose,
        hausdorff_percent_of(character, row));
  }
  Figures median() const {
    return {median_of(overlap), median_of(psnr_db), median_of(ssim), median_of(hausdorff_percent)};
  }
  Figures worst() const {
    const auto least = [](const std::vector<double>& v) {
      return *std::min_element(v.begin(), v.end());
    };
    return {least(overlap), least(psnr_db), least(ssim),
            *std::max_element(hausdorff_percent.begin(), hausdorff_percent.end())};
  }
};

void add_fields(const Figures& f, std::string& csv) {
  absl::StrAppendFormat(&csv, ",%.5f,%.3f,%.5f,%.3f", f.overlap, f.psnr_db, f.ssim,
                        f.hausdorff_percent);
}

const LevelReport* find(const CharacterReport& character, std::uint32_t level, Method method) {
  for (const LevelReport& row : character.levels) {
    if (row.level == level && row.method == method) return &row;
  }
  return nullptr;
}

double triangle_ratio(const LevelReport& row, const LevelReport& ours) {
  return static_cast<double>(row.triangles) / std::max(1U, ours.triangles);
}

}  // namespace

std::vector<SummaryRow> summarize(const std::vector<CharacterReport>& characters) {
  std::vector<SummaryRow> rows;
  for (std::uint32_t level = 0; level < kLevelSpecs.size(); ++level) {
    for (const Method method : kMethods) {
      Gathered median, worst_pose;
      std::vector<double> ratio;
      for (const CharacterReport& character : characters) {
        const LevelReport* row = find(character, level, method);
        const LevelReport* ours = find(character, level, Method::kThrong);
        if (row == nullptr || ours == nullptr) continue;
        median.add_median(character, *row);
        worst_pose.add_worst_pose(character, *row);
        ratio.push_back(triangle_ratio(*row, *ours));
      }
      if (ratio.empty()) continue;
      rows.push_back({method, level, static_cast<std::uint32_t>(ratio.size()), median.median(),
                      worst_pose.median(), worst_pose.worst(), median_of(ratio)});
    }
  }
  return rows;
}

std::vector<ComparisonRow> compare(const std::vector<CharacterReport>& characters) {
  std::vector<ComparisonRow> rows;
  for (std::uint32_t level = 1; level < kLevelSpecs.size(); ++level) {
    for (const Method method : kMethods) {
      if (method == Method::kThrong) continue;
      ComparisonRow row;
      row.rival = method;
      row.level = level;
      Gathered our_median, our_worst, median, worst;
      for (const CharacterReport& character : characters) {
        const LevelReport* theirs = find(character, level, method);
        const LevelReport* ours = find(character, level, Method::kThrong);
        if (theirs == nullptr || ours == nullptr) continue;
        if (is_stuck(*ours, *theirs)) {
          ++row.stuck;
          ours = find(character, level,
                      method == Method::kAttributes ? Method::kAtAttributes : Method::kAtPlain);
          if (ours == nullptr) continue;
        }
        ++row.characters;
        our_median.add_median(character, *ours);
        our_worst.add_worst_pose(character, *ours);
        median.add_median(character, *theirs);
        worst.add_worst_pose(character, *theirs);
        row.no_worse += ours->ssim.median >= theirs->ssim.median ? 1 : 0;
      }
      if (row.characters == 0) continue;
      row.throng_median = our_median.median();
      row.throng_worst_pose = our_worst.median();
      row.rival_median = median.median();
      row.rival_worst_pose = worst.median();
      rows.push_back(row);
    }
  }
  return rows;
}

std::string levels_csv(const std::vector<CharacterReport>& characters) {
  std::string csv =
      "character,method,level,native_px,vertices,triangles,overlap_median,overlap_worst_pose,"
      "overlap_pose,psnr_db_median,psnr_db_worst_pose,psnr_pose,ssim_median,ssim_worst_pose,"
      "ssim_pose,hausdorff_mm,hausdorff_percent,hausdorff_pose,file_bytes,bake_s\n";
  for (const CharacterReport& character : characters) {
    for (const LevelReport& row : character.levels) {
      const LevelSpec& spec = kLevelSpecs[row.level];
      absl::StrAppendFormat(&csv, "%s,%s,%s,%u,%u,%u", field(character.name),
                            method_name(row.method), spec.name, spec.native_px, row.vertices,
                            row.triangles);
      const std::pair<const Spread*, int> spreads[] = {
          {&row.overlap, 5}, {&row.psnr_db, 3}, {&row.ssim, 5}};
      for (const auto& [spread, digits] : spreads) {
        absl::StrAppendFormat(&csv, ",%.*f,%.*f,%s", digits, spread->median, digits,
                              spread->worst_pose, field(character.poses[spread->pose]));
      }
      absl::StrAppendFormat(&csv, ",%.2f,%.3f,%s,%u,", 1000.0F * row.hausdorff_m,
                            hausdorff_percent_of(character, row),
                            field(character.poses[row.hausdorff_pose]), character.file_bytes);
      if (character.bake_s >= 0.0) absl::StrAppendFormat(&csv, "%.2f", character.bake_s);
      csv += '\n';
    }
  }
  return csv;
}

std::string sampling_csv(const std::vector<CharacterReport>& characters) {
  std::string csv =
      "character,level,frames,usual_frames,sampled_frames,rms_percent_sampled,rms_percent_usual,"
      "rms_percent_all,max_percent_sampled,max_percent_usual,max_percent_all,worst_frame_left_out,"
      "worst_frame_rms_percent,farthest_frame,farthest_percent\n";
  for (const CharacterReport& character : characters) {
    if (!character.sampling.has_value()) continue;
    const SamplingCost& cost = *character.sampling;
    const auto percent = [&](float m) {
      return 100.0 * static_cast<double>(m / character.height_m);
    };
    for (const SamplingCost::Level& level : cost.levels) {
      absl::StrAppendFormat(&csv, "%s,%s,%u,%u,%u,%.4f,%.4f,%.4f,%.3f,%.3f,%.3f,%s,",
                            field(character.name), kLevelSpecs[level.level].name, cost.frames,
                            cost.usual, cost.sampled, percent(level.sampled.rms_m),
                            percent(level.usual.rms_m), percent(level.all.rms_m),
                            percent(level.sampled.max_m), percent(level.usual.max_m),
                            percent(level.all.max_m), field(level.worst_left_out));
      // nothing where no frame was left out
      if (!level.worst_left_out.empty())
        absl::StrAppendFormat(&csv, "%.4f", percent(level.worst_left_out_rms_m));
      absl::StrAppend(&csv, ",", field(cost.farthest), ",");
      if (!cost.farthest.empty()) absl::StrAppendFormat(&csv, "%.3f", percent(cost.farthest_m));
      csv += '\n';
    }
  }
  return csv;
}

std::string summary_csv(const std::vector<SummaryRow>& rows) {
  std::string csv = "level,method,characters,triangles_to_throng";
  for (const char* of : {"median", "worst_pose", "worst"})
    absl::StrAppend(&csv, ",overlap_", of, ",psnr_db_", of, ",ssim_", of, ",hausdorff_percent_",
                    of);
  csv += '\n';
  for (const SummaryRow& row : rows) {
    absl::StrAppendFormat(&csv, "%s,%s,%u,%.2f", kLevelSpecs[row.level].name,
                          method_name(row.method), row.characters, row.triangle_ratio);
    for (const Figures* f : {&row.median, &row.worst_pose, &row.worst}) add_fields(*f, csv);
    csv += '\n';
  }
  return csv;
}

std::string comparison_csv(const std::vector<ComparisonRow>& rows) {
  std::string csv = "level,rival,characters,rival_stuck,throng_ssim_no_worse";
  for (const char* of : {"throng_median", "rival_median", "throng_worst_pose", "rival_worst_pose"})
    absl::StrAppend(&csv, ",overlap_", of, ",psnr_db_", of, ",ssim_", of, ",hausdorff_percent_",
                    of);
  csv += '\n';
  for (const ComparisonRow& row : rows) {
    absl::StrAppendFormat(&csv, "%s,%s,%u,%u,%u", kLevelSpecs[row.level].name,
                          method_name(row.rival), row.characters, row.stuck, row.no_worse);
    for (const Figures* f :
         {&row.throng_median, &row.rival_median, &row.throng_worst_pose, &row.rival_worst_pose}) {
      add_fields(*f, csv);
    }
    csv += '\n';
  }
  return csv;
}

std::string report_json(const ReportResult& result) {
  using Json = nlohmann::ordered_json;
  Json json = {{"characters", result.characters.size()},
               {"seconds", result.seconds},
               {"errors", result.errors},
               {"notes", result.notes},
               {"summary", Json::array()}};
  const auto figures = [](const Figures& f) {
    return Json{{"overlap", f.overlap},
                {"psnr_db", f.psnr_db},
                {"ssim", f.ssim},
                {"hausdorff_percent", f.hausdorff_percent}};
  };
  for (const SummaryRow& row : summarize(result.characters)) {
    json["summary"].push_back({{"level", kLevelSpecs[row.level].name},
                               {"method", method_name(row.method)},
                               {"characters", row.characters},
                               {"triangles_to_throng", row.triangle_ratio},
                               {"median", figures(row.median)},
                               {"worst_pose", figures(row.worst_pose)},
                               {"worst", figures(row.worst)}});
  }
  json["sampling"] = Json::array();
  for (const CharacterReport& character : result.characters) {
    if (!character.sampling.has_value()) continue;
    const SamplingCost& cost = *character.sampling;
    Json levels = Json::array();
    for (const SamplingCost::Level& level : cost.levels) {
      levels.push_back({{"level", kLevelSpecs[level.level].name},
                        {"rms_m_sampled", level.sampled.rms_m},
                        {"rms_m_usual", level.usual.rms_m},
                        {"rms_m_all", level.all.rms_m},
                        {"max_m_sampled", level.sampled.max_m},
                        {"max_m_usual", level.usual.max_m},
                        {"max_m_all", level.all.max_m}});
    }
    json["sampling"].push_back({{"character", character.name},
                                {"frames", cost.frames},
                                {"usual_frames", cost.usual},
                                {"sampled_frames", cost.sampled},
                                {"farthest_m", cost.farthest_m},
                                {"levels", std::move(levels)}});
  }
  json["same_triangles"] = Json::array();
  for (const ComparisonRow& row : compare(result.characters)) {
    json["same_triangles"].push_back({{"level", kLevelSpecs[row.level].name},
                                      {"rival", method_name(row.rival)},
                                      {"characters", row.characters},
                                      {"rival_stuck", row.stuck},
                                      {"throng_ssim_no_worse", row.no_worse},
                                      {"throng_median", figures(row.throng_median)},
                                      {"rival_median", figures(row.rival_median)},
                                      {"throng_worst_pose", figures(row.throng_worst_pose)},
                                      {"rival_worst_pose", figures(row.rival_worst_pose)}});
  }
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace throng::simplify
