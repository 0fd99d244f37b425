#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <cstdio>
#include <tuple>
#include <utility>

#include "simplify/report/report.hpp"

namespace throng::simplify {
namespace {

constexpr const char* kStyle = R"(
:root { color-scheme: light dark; --line: #8884; --worse: #c0392b; --quiet: #777; }
body { font: 14px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 1440px; padding: 0 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin: 2.2rem 0 .4rem; }
p { margin: .4rem 0; max-width: 72ch; }
table { border-collapse: collapse; margin: .6rem 0; font-variant-numeric: tabular-nums; }
th, td { text-align: right; padding: .1rem .5rem; border-bottom: 1px solid var(--line); white-space: nowrap; }
th { font-weight: 600; color: var(--quiet); } th:first-child, td:first-child, td.words { text-align: left; }
tr.first td { border-top: 2px solid var(--line); }
.worse { color: var(--worse); font-weight: 600; }
.scroll { overflow-x: auto; } img { max-width: 100%; border-radius: 6px; border: 1px solid var(--line); }
figure { margin: .6rem 0; } .quiet { color: var(--quiet); } details { margin: .5rem 0; } summary { cursor: pointer; }
)";

std::string escaped(const std::string& text) {
  std::string html;
  for (const char c : text) {
    switch (c) {
      case '&':
        html += "&amp;";
        break;
      case '<':
        html += "&lt;";
        break;
      case '>':
        html += "&gt;";
        break;
      case '"':
        html += "&quot;";
        break;
      default:
        html += c;
    }
  }
  return html;
}

/// Smaller differences than these are shown as equal.
constexpr double kOverlapStep = 5.0e-4, kPsnrStep = 0.05, kSsimStep = 5.0e-4, kHausdorffStep = 0.05;

bool is_rival(Method method) { return method == Method::kAttributes || method == Method::kPlain; }

std::string cell(const std::string& text, bool is_worse) {
  return absl::StrCat(is_worse ? "<td class=\"worse\">" : "<td>", text, "</td>");
}

struct Measure {
  const char* name;
  double Figures::*value;
  double step;  // positive: more is better, negative: less is
  const char* format;
};
const Measure kMeasures[] = {
    {"silhouette overlap", &Figures::overlap, kOverlapStep, "%.3f"},
    {"PSNR", &Figures::psnr_db, kPsnrStep, "%.2f dB"},
    {"SSIM", &Figures::ssim, kSsimStep, "%.4f"},
    {"Hausdorff distance", &Figures::hausdorff_percent, -kHausdorffStep, "%.2f %%"}};

bool is_worse(double ours, double theirs, double step) {
  return step > 0.0 ? ours < theirs - step : ours > theirs - step;
}

std::string format(const char* pattern, double value) {
  char text[64];
  std::snprintf(text, sizeof(text), pattern, value);
  return text;
}

void add_summary(const std::vector<SummaryRow>& rows, std::string& html) {
  absl::StrAppend(
      &html,
      "<div class=\"scroll\"><table><tr><th>level</th><th>method</th><th>triangles<br><span "
      "class=\"quiet\">to throng</span></th>");
  for (const char* of : {"median", "worst pose"}) {
    for (const char* what : {"overlap", "PSNR dB", "SSIM", "Hausdorff %"})
      absl::StrAppend(&html, "<th>", what, "<br><span class=\"quiet\">", of, "</span></th>");
  }
  html += "</tr>\n";
  for (const SummaryRow& row : rows) {
    const bool is_ours = row.method == Method::kThrong;
    absl::StrAppend(&html, is_ours ? "<tr class=\"first\">" : "<tr>", "<td>",
                    is_ours ? kLevelSpecs[row.level].name : "", "</td><td class=\"words\">",
                    method_name(row.method), "</td>",
                    cell(absl::StrFormat("%.2f", row.triangle_ratio), false));
    for (const Figures* f : {&row.median, &row.worst_pose})
      absl::StrAppendFormat(&html, "<td>%.3f</td><td>%.2f</td><td>%.4f</td><td>%.2f</td>",
                            f->overlap, f->psnr_db, f->ssim, f->hausdorff_percent);
    html += "</tr>\n";
  }
  html += "</table></div>\n";
}

/// throng / rival, red where it is less good.
void add_pair(const Measure& measure, const Figures& ours, const Figures& theirs,
              std::string& html) {
  const double a = ours.*measure.value, b = theirs.*measure.value;
  html += cell(absl::StrCat(format(measure.format, a), " / ", format(measure.format, b)),
               is_worse(a, b, measure.step));
}

/// At the same triangle counts, and in words where the goal isn't met.
void add_comparison(const std::vector<ComparisonRow>& rows, std::string& html) {
  if (rows.empty()) return;
  html +=
      "<h2>At the same triangle counts</h2>\n<p>throng / meshoptimizer, medians over characters. "
      "Where meshoptimizer is stuck above throng's triangle count (by more than 5 %), throng is "
      "drawn with meshoptimizer's count instead. Red: throng is worse.</p>\n"
      "<div "
      "class=\"scroll\"><table><tr><th>level</th><th>rival</th><th>characters</th><th>stuck</th>";
  for (const char* of : {"median", "worst pose"}) {
    for (const Measure& measure : kMeasures)
      absl::StrAppend(&html, "<th>", measure.name, "<br><span class=\"quiet\">", of,
                      "</span></th>");
  }
  html += "<th>SSIM no worse<br><span class=\"quiet\">characters</span></th></tr>\n";
  std::string losses;
  for (const ComparisonRow& row : rows) {
    const char* level = kLevelSpecs[row.level].name;
    absl::StrAppendFormat(&html,
                          "<tr%s><td>%s</td><td class=\"words\">%s</td><td>%u</td><td>%u</td>",
                          row.rival == Method::kAttributes ? " class=\"first\"" : "", level,
                          method_name(row.rival), row.characters, row.stuck);
    const std::tuple<const char*, const Figures*, const Figures*> parts[] = {
        {"in the median", &row.throng_median, &row.rival_median},
        {"in the worst pose", &row.throng_worst_pose, &row.rival_worst_pose}};
    for (const auto& [words, ours, theirs] : parts) {
      for (const Measure& measure : kMeasures) {
        add_pair(measure, *ours, *theirs, html);
        const double a = ours->*measure.value, b = theirs->*measure.value;
        if (!is_worse(a, b, measure.step)) continue;
        absl::StrAppend(&losses, "<li>", level, ", ", words, ": ", measure.name, " ",
                        format(measure.format, a), " against ", format(measure.format, b), " of ",
                        method_name(row.rival), "</li>\n");
      }
    }
    absl::StrAppendFormat(&html, "<td>%u of %u</td></tr>\n", row.no_worse, row.characters);
  }
  html += "</table></div>\n";
  if (losses.empty()) {
    html +=
        "<p>throng is nowhere worse, in the median over characters and in their worst poses.</p>\n";
  } else {
    absl::StrAppend(&html, "<p class=\"worse\">Where throng is worse:</p><ul>\n", losses,
                    "</ul>\n");
  }
}

/// What it costs that levels were made in some frames only, in a sentence and a table.
void add_sampling(const CharacterReport& character, std::string& html) {
  html += "<h3>What the sampling of poses costs</h3>\n";
  if (!character.sampling.has_value()) {
    html +=
        "<p class=\"quiet\">Not known: no cast.json tells in which frames this character's levels "
        "were made. Bake it again, and give the folder of the cast.</p>\n";
    return;
  }
  const SamplingCost& cost = *character.sampling;
  const auto percent = [&](float m) { return 100.0 * static_cast<double>(m / character.height_m); };
  absl::StrAppendFormat(&html, "<p>The levels were made in the bind pose and %u of %u frames.",
                        cost.sampled, cost.frames);
  if (cost.sampled == cost.frames) {
    html += " None was left out, so the sampling costs nothing.</p>\n";
    return;
  }
  if (!cost.farthest.empty()) {
    absl::StrAppendFormat(&html,
                          " The one least like any of these, %s, has its surface %.2f %% of the "
                          "height away from the nearest of them in the mean.",
                          escaped(cost.farthest), percent(cost.farthest_m));
  }
  const std::pair<const char*, SamplingCost::Distance SamplingCost::Level::*> sets[] = {
      {"the frames of idle, walk and run", &SamplingCost::Level::usual},
      {"all frames", &SamplingCost::Level::all}};
  for (const auto& [name, set] : sets) {
    const SamplingCost::Level* worst = nullptr;
    for (const SamplingCost::Level& level : cost.levels) {
      if (worst == nullptr || level.excess(level.*set) > worst->excess(worst->*set)) worst = &level;
    }
    if (worst == nullptr) continue;
    const float excess = worst->excess(worst->*set);
    if (excess > 0.005F) {
      absl::StrAppendFormat(&html,
                            " Over %s, levels are up to %.0f %% farther from the full mesh than "
                            "over the sampled ones (%s).",
                            name, 100.0F * excess, kLevelSpecs[worst->level].name);
    } else {
      absl::StrAppendFormat(
          &html, " Over %s, no level is farther from the full mesh than over the sampled ones.",
          name);
    }
  }
  html +=
      "</p>\n<div class=\"scroll\"><table><tr><th>level</th><th>RMS %<br><span "
      "class=\"quiet\">sampled frames</span></th><th>RMS %<br><span class=\"quiet\">idle, "
      "walk, run</span></th><th>RMS %<br><span class=\"quiet\">all frames</span></th><th>largest "
      "%<br><span class=\"quiet\">sampled frames</span></th><th>largest %<br><span "
      "class=\"quiet\">idle, walk, run</span></th><th>largest %<br><span class=\"quiet\">all "
      "frames</span></th><th>RMS %<br><span class=\"quiet\">worst left "
      "out</span></th><th>which</th></tr>\n";
  for (const SamplingCost::Level& level : cost.levels) {
    absl::StrAppendFormat(&html, "<tr><td>%s</td><td>%.3f</td>", kLevelSpecs[level.level].name,
                          percent(level.sampled.rms_m));
    for (const SamplingCost::Distance& set : {level.usual, level.all})
      html += cell(absl::StrFormat("%.3f", percent(set.rms_m)), level.excess(set) > 0.1F);
    absl::StrAppendFormat(
        &html,
        "<td>%.2f</td><td>%.2f</td><td>%.2f</td><td>%.3f</td><td class=\"words\">%s</td></tr>\n",
        percent(level.sampled.max_m), percent(level.usual.max_m), percent(level.all.max_m),
        percent(level.worst_left_out_rms_m), escaped(level.worst_left_out));
  }
  html +=
      "</table></div>\n<p class=\"quiet\">Distance between a level and the full mesh, both ways, "
      "in "
      "% of the height. Red: over a tenth more than in the sampled frames.</p>\n";
}

void add_character(const CharacterReport& character, std::string& html) {
  absl::StrAppendFormat(
      &html,
      "<h2 id=\"%s\">%s</h2>\n<p class=\"quiet\">%u vertices, %u triangles, %u joints, "
      "%.2f m tall, coarsest %u vertices; file %.1f MiB; %s; measured in %.1f s</p>\n",
      escaped(character.name), escaped(character.name), character.vertices, character.triangles,
      character.joints, character.height_m, character.coarsest_vertices,
      static_cast<double>(character.file_bytes) / 1048576.0,
      character.bake_s >= 0.0 ? absl::StrFormat("baked in %.2f s", character.bake_s)
                              : std::string("bake time not recorded"),
      character.report_s);
  html +=
      "<div "
      "class=\"scroll\"><table><tr><th>level</th><th>method</th><th>vertices</th><th>triangles</th>"
      "<th>overlap</th><th>worst pose</th><th>PSNR dB</th><th>worst "
      "pose</th><th>SSIM</th><th>worst pose</th>"
      "<th>Hausdorff mm</th><th>%</th><th>worst pose by SSIM, by distance</th></tr>\n";
  for (std::uint32_t level = 0; level < kLevelSpecs.size(); ++level) {
    const LevelReport* ours = nullptr;
    for (const LevelReport& row : character.levels) {
      if (row.level == level && row.method == Method::kThrong) ours = &row;
    }
    for (const LevelReport& row : character.levels) {
      if (row.level != level) continue;
      // ours is marked where any rival is better
      const auto beaten = [&](auto value, double step) {
        if (&row != ours) return false;
        for (const LevelReport& other : character.levels) {
          if (other.level == level && is_rival(other.method) && !is_stuck(row, other) &&
              is_worse(value(row), value(other), step)) {
            return true;
          }
        }
        return false;
      };
      const double percent = 100.0 * static_cast<double>(row.hausdorff_m / character.height_m);
      absl::StrAppendFormat(
          &html, "<tr%s><td>%s</td><td class=\"words\">%s</td><td>%u</td><td>%u%s</td>",
          row.method == Method::kThrong ? " class=\"first\"" : "",
          row.method == Method::kThrong ? kLevelSpecs[level].name : "", method_name(row.method),
          row.vertices, row.triangles,
          is_rival(row.method) && ours != nullptr && is_stuck(*ours, row) ? " (stuck)" : "");
      html += cell(absl::StrFormat("%.3f", row.overlap.median),
                   beaten([](const LevelReport& r) { return r.overlap.median; }, kOverlapStep));
      html += cell(absl::StrFormat("%.3f", row.overlap.worst_pose),
                   beaten([](const LevelReport& r) { return r.overlap.worst_pose; }, kOverlapStep));
      html += cell(absl::StrFormat("%.2f", row.psnr_db.median),
                   beaten([](const LevelReport& r) { return r.psnr_db.median; }, kPsnrStep));
      html += cell(absl::StrFormat("%.2f", row.psnr_db.worst_pose),
                   beaten([](const LevelReport& r) { return r.psnr_db.worst_pose; }, kPsnrStep));
      html += cell(absl::StrFormat("%.4f", row.ssim.median),
                   beaten([](const LevelReport& r) { return r.ssim.median; }, kSsimStep));
      html += cell(absl::StrFormat("%.4f", row.ssim.worst_pose),
                   beaten([](const LevelReport& r) { return r.ssim.worst_pose; }, kSsimStep));
      html += cell(absl::StrFormat("%.1f", 1000.0F * row.hausdorff_m), false);
      html += cell(absl::StrFormat("%.2f", percent),
                   beaten(
                       [&](const LevelReport& r) {
                         return 100.0 * static_cast<double>(r.hausdorff_m / character.height_m);
                       },
                       -kHausdorffStep));
      absl::StrAppend(&html, "<td class=\"words\">", escaped(character.poses[row.ssim.pose]), "; ",
                      escaped(character.poses[row.hausdorff_pose]), "</td></tr>\n");
    }
  }
  html += "</table></div>\n";
  add_sampling(character, html);
  absl::StrAppend(
      &html, "<figure><img src=\"", escaped(character.levels_png),
      "\" alt=\"levels by method\" loading=\"lazy\"></figure>\n<details><summary>The worst "
      "picture of each level, as "
      "seen at native height and enlarged</summary><img src=\"",
      escaped(character.worst_png), "\" alt=\"worst pictures\" loading=\"lazy\"></details>\n");
}

}  // namespace

std::string report_html(const ReportResult& result, const ReportOptions& options,
                        const std::string& extra_html) {
  std::string html = absl::StrCat(
      "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>Levels of "
      "detail</title>"
      "<meta name=\"viewport\" content=\"width=device-width\"><style>",
      kStyle, "</style></head><body>\n<h1>Levels of detail</h1>\n");
  absl::StrAppendFormat(
      &html, "<p>%u characters, %u views by at most %u poses each, measured in %.0f s.</p>\n",
      result.characters.size(), options.measure.views, options.measure.poses, result.seconds);
  html +=
      "<p>Each level is compared with the full mesh: drawn by the visibility rasterizer with 16 "
      "samples a pixel, as tall as "
      "such a level is shown (400, 200, 120, 60, 40 and 20 px). Overlap is the common area of both "
      "silhouettes over their joint "
      "area. PSNR and SSIM (luma, 11 x 11 Gaussian of sigma 1.5) look at the pixels within 8 px of "
      "the figure. The "
      "Hausdorff distance is two-sided between surface samples, the largest of all poses, in % of "
      "the height. "
      "<i>Median</i> is over all pictures; <i>worst pose</i> is the mean over the views in the "
      "pose where that is worst. "
      "PSNR stops at 99 dB, which stands for no difference. The full level is the full mesh "
      "itself.</p>\n";
  html +=
      "<p>meshoptimizer simplifies the same full mesh, in the bind pose, to at most as many "
      "triangles, once by positions alone and "
      "once with normals and texture coordinates as attributes; its meshes need not be nested, "
      "ours are one order. "
      "Skin weights, texture and measuring are the same for all.";
  if (const std::string version = plain_meshoptimizer_version(); !version.empty())
    absl::StrAppend(&html, " Plain: version ", version, " of the C library.");
  if (!options.python.empty()) {
    if (const auto version = attribute_meshoptimizer_version(options.python); version.ok())
      absl::StrAppend(&html, " Attributes: package meshoptimizer ", *version,
                      " from PyPI (weights ", options.measure.attribute_weights.normal,
                      " for normals, ", options.measure.attribute_weights.uv, " for uv).");
  }
  html += "</p>\n";
  for (const std::string& note : result.notes)
    absl::StrAppend(&html, "<p class=\"worse\">", escaped(note), "</p>\n");
  for (const std::string& error : result.errors)
    absl::StrAppend(&html, "<p class=\"worse\">Not reported: ", escaped(error), "</p>\n");
  const std::vector<SummaryRow> rows = summarize(result.characters);
  html +=
      "<h2>All characters</h2>\n<p>Median over characters. <a href=\"levels.csv\">levels.csv</a>, "
      "<a "
      "href=\"summary.csv\">summary.csv</a>, <a href=\"sampling.csv\">sampling.csv</a>, <a "
      "href=\"comparison.csv\">comparison.csv</a></p>\n";
  add_summary(rows, html);
  add_comparison(compare(result.characters), html);
  html += extra_html;
  html += "<h2>Characters, what loses most first</h2>\n<p>";
  for (const CharacterReport& character : result.characters)
    absl::StrAppend(&html, "<a href=\"#", escaped(character.name), "\">", escaped(character.name),
                    "</a> ");
  html += "</p>\n<p class=\"quiet\">Red: meshoptimizer does better with as many triangles.</p>\n";
  for (const CharacterReport& character : result.characters) add_character(character, html);
  html += "</body></html>\n";
  return html;
}

}  // namespace throng::simplify
