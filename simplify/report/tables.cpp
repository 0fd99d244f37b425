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

double hausdorff_percent(const CharacterReport& character, const LevelReport& row) {
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

std::vector<SummaryRow> summarize(const std::vector<CharacterReport>& characters) {
  std::vector<SummaryRow> rows;
  for (std::uint32_t level = 0; level < kLevelSpecs.size(); ++level) {
    for (const Method method : kMethods) {
      SummaryRow row{method, level, 0, {}, {}, {}, 1.0, 0};
      // overlap, psnr, ssim, hausdorff
      std::vector<double> median[4], worst[4], ratio;
      for (const CharacterReport& character : characters) {
        const LevelReport* ours = nullptr;
        for (const LevelReport& one : character.levels) {
          if (one.level != level) continue;
          if (one.method == Method::kThrong) ours = &one;
          if (one.method != method) continue;
          ++row.characters;
          const double distance = hausdorff_percent(character, one);
          const double medians[4] = {one.overlap.median, one.psnr_db.median, one.ssim.median,
                                     distance};
          const double worsts[4] = {one.overlap.worst_pose, one.psnr_db.worst_pose,
                                    one.ssim.worst_pose, distance};
          for (int k = 0; k < 4; ++k) {
            median[k].push_back(medians[k]);
            worst[k].push_back(worsts[k]);
          }
          if (ours != nullptr)
            ratio.push_back(static_cast<double>(one.triangles) / std::max(1U, ours->triangles));
          if (ours != nullptr && ours->ssim.median >= one.ssim.median) ++row.at_least_as_good;
        }
      }
      if (row.characters == 0) continue;
      row.triangle_ratio = median_of(ratio);
      row.median = {median_of(median[0]), median_of(median[1]), median_of(median[2]),
                    median_of(median[3])};
      row.worst_pose = {median_of(worst[0]), median_of(worst[1]), median_of(worst[2]),
                        median_of(worst[3])};
      const auto least = [](const std::vector<double>& v) {
        return *std::min_element(v.begin(), v.end());
      };
      row.worst = {least(worst[0]), least(worst[1]), least(worst[2]),
                   *std::max_element(worst[3].begin(), worst[3].end())};
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
                            hausdorff_percent(character, row),
                            field(character.poses[row.hausdorff_pose]), character.file_bytes);
      if (character.bake_s >= 0.0) absl::StrAppendFormat(&csv, "%.2f", character.bake_s);
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
  csv += ",throng_at_least_as_good\n";
  for (const SummaryRow& row : rows) {
    absl::StrAppendFormat(&csv, "%s,%s,%u,%.2f", kLevelSpecs[row.level].name,
                          method_name(row.method), row.characters, row.triangle_ratio);
    for (const SummaryRow::Figures* f : {&row.median, &row.worst_pose, &row.worst})
      absl::StrAppendFormat(&csv, ",%.5f,%.3f,%.5f,%.3f", f->overlap, f->psnr_db, f->ssim,
                            f->hausdorff_percent);
    absl::StrAppendFormat(&csv, ",%u\n", row.at_least_as_good);
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
  const auto figures = [](const SummaryRow::Figures& f) {
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
                               {"worst", figures(row.worst)},
                               {"throng_at_least_as_good", row.at_least_as_good}});
  }
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace throng::simplify
