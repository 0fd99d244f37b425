#include "simplify/report/measure.hpp"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include "simplify/report/canvas.hpp"
#include "simplify/report/hausdorff.hpp"
#include "simplify/report/studio.hpp"
#include "throng/render/quality.hpp"

namespace throng::simplify {
namespace {

constexpr std::uint32_t kNearPx = 8;  // pixels this near a figure are compared (design: section 8)
constexpr int kMarginPx = 14;         // those and half a window of SSIM
constexpr int kSheetPx = 3072;        // figures are drawn on sheets of about this size
constexpr double kSamePsnrDb = 99.0;  // stands for no difference
constexpr float kLowElevationRad = 0.09F, kHighElevationRad = 0.52F;

/// Where one figure stands on a sheet, in pixels at native size.
struct Cell {
  std::uint32_t view = 0, pose = 0;
  int x = 0, y = 0, width = 0, height = 0;
  glm::vec2 origin{0.0F};
};
struct Sheet {
  float elevation_rad = 0.0F;
  int width = 0, height = 0;
  std::vector<Cell> cells;
};

/// A figure by itself, at native size.
struct Shown {
  render::Picture picture;
  std::vector<std::uint8_t> silhouette;  // at twice the size: at least half covered
  std::vector<std::uint8_t> touched;     // at native size: covered at all
};

std::vector<ViewAngle> view_angles(std::uint32_t count) {
  std::vector<ViewAngle> views;
  for (std::uint32_t i = 0; i < count; ++i) {
    views.push_back({6.2831853F * static_cast<float>(i) / static_cast<float>(count),
                     i % 2 == 0 ? kLowElevationRad : kHighElevationRad});
  }
  return views;
}

Spread spread_of(const std::vector<double>& values, std::size_t views) {
  Spread spread;
  std::vector<double> sorted = values;
  std::sort(sorted.begin(), sorted.end());
  spread.median = 0.5 * (sorted[(sorted.size() - 1) / 2] + sorted[sorted.size() / 2]);
  spread.worst_pose = HUGE_VAL;
  for (std::size_t pose = 0; pose * views < values.size(); ++pose) {
    double sum = 0.0;
    for (std::size_t view = 0; view < views; ++view) sum += values[pose * views + view];
    if (sum / static_cast<double>(views) < spread.worst_pose) {
      spread.worst_pose = sum / static_cast<double>(views);
      spread.pose = static_cast<std::uint32_t>(pose);
    }
  }
  return spread;
}

class Measurer {
 public:
  Measurer(const render::Character& character, const MeasureOptions& options)
      : character_(character), options_(options), report_{} {}

  absl::StatusOr<Measured> run();

 private:
  std::vector<Sheet> lay_out(std::uint32_t native_px) const;
  absl::StatusOr<std::vector<Shown>> show(const LevelMesh& mesh, const std::vector<Sheet>& sheets,
                                          std::uint32_t native_px);
  absl::Status compare(const std::vector<Shown>& reference, const std::vector<Shown>& shown,
                       LevelReport& row) const;
  void measure_distance(const LevelMesh& mesh, LevelReport& row) const;
  /// All of the above for one mesh at the row's level.
  absl::StatusOr<std::vector<Shown>> judge(const LevelMesh& mesh, const std::vector<Sheet>& sheets,
                                           const std::vector<Shown>& reference, LevelReport& row);
  absl::StatusOr<render::Picture> portrait(const LevelMesh& mesh, int width, int height,
                                           const glm::vec2& origin, float px_per_m);
  absl::StatusOr<render::Picture> paint_levels();
  render::Picture paint_worst() const;

  const render::Character& character_;
  const MeasureOptions& options_;
  CharacterReport report_;
  std::vector<PoseId> poses_;
  std::vector<PosedVertices> posed_;
  std::unique_ptr<Studio> studio_;
  LevelMesh full_;
  std::vector<std::vector<LevelMesh>> meshes_;  // [method][level], empty where a method can't run
  std::optional<SurfaceSamples> full_samples_;
  std::vector<TriangleTree> full_trees_;  // by pose
  struct Worst {
    std::uint32_t level;
    std::string words;
    std::vector<render::Picture> pictures;  // full mesh, then methods
  };
  std::vector<Worst> worst_;
};

/// Shelves from left to right, new ones below; full sheets make room for new ones.
std::vector<Sheet> Measurer::lay_out(std::uint32_t native_px) const {
  const float px_per_m = static_cast<float>(native_px) / character_.height_m;
  std::vector<Sheet> sheets;
  for (const float elevation_rad : {kLowElevationRad, kHighElevationRad}) {
    int x = 0, shelf = 0;
    sheets.push_back({elevation_rad, 0, 0, {}});
    for (std::uint32_t pose = 0; pose < poses_.size(); ++pose) {
      for (std::uint32_t view = 0; view < report_.views.size(); ++view) {
        if (report_.views[view].elevation_rad != elevation_rad) continue;
        const Frame frame = frame_of(posed_[pose], report_.views[view].turn_rad, elevation_rad);
        Cell cell{view, pose, 0, 0, 0, 0, glm::vec2(0.0F)};
        cell.width =
            static_cast<int>(std::ceil((frame.high.x - frame.low.x) * px_per_m)) + 2 * kMarginPx;
        cell.height =
            static_cast<int>(std::ceil((frame.high.y - frame.low.y) * px_per_m)) + 2 * kMarginPx;
        if (x > 0 && x + cell.width > kSheetPx) {
          x = 0;
          shelf = sheets.back().height;
        }
        if (shelf > 0 && shelf + cell.height > kSheetPx) {
          sheets.push_back({elevation_rad, 0, 0, {}});
          x = shelf = 0;
        }
        cell.x = x;
        cell.y = shelf;
        cell.origin = glm::vec2(x + kMarginPx, shelf + kMarginPx) - frame.low * px_per_m;
        x += cell.width;
        Sheet& sheet = sheets.back();
        sheet.width = std::max(sheet.width, x);
        sheet.height = std::max(sheet.height, shelf + cell.height);
        sheet.cells.push_back(cell);
      }
    }
    if (sheets.back().cells.empty()) sheets.pop_back();
  }
  return sheets;
}

absl::StatusOr<std::vector<Shown>> Measurer::show(const LevelMesh& mesh,
                                                  const std::vector<Sheet>& sheets,
                                                  std::uint32_t native_px) {
  // drawn at twice the size with four samples a pixel: sixteen at native size
  std::vector<Shown> all(report_.views.size() * poses_.size());
  render::Picture picture;
  std::vector<std::uint8_t> samples;
  for (const Sheet& sheet : sheets) {
    const Shot shot{sheet.elevation_rad, 2.0F * static_cast<float>(native_px) / character_.height_m,
                    static_cast<std::uint32_t>(2 * sheet.width),
                    static_cast<std::uint32_t>(2 * sheet.height)};
    std::vector<Figure> figures;
    for (const Cell& cell : sheet.cells)
      figures.push_back(
          {&posed_[cell.pose], report_.views[cell.view].turn_rad, 2.0F * cell.origin});
    if (auto status = studio_->draw(mesh, figures, shot, picture); !status.ok()) return status;
    if (auto status = studio_->cover(mesh, figures, shot, samples); !status.ok()) return status;
    const render::Picture native = halved(picture);
    for (const Cell& cell : sheet.cells) {
      Shown& shown = all[cell.view + cell.pose * report_.views.size()];
      const auto width = static_cast<std::size_t>(cell.width),
                 height = static_cast<std::size_t>(cell.height);
      shown.picture.width_px = static_cast<std::uint32_t>(width);
      shown.picture.height_px = static_cast<std::uint32_t>(height);
      shown.picture.rgbx.resize(4 * width * height);
      shown.silhouette.resize(4 * width * height);
      shown.touched.resize(width * height);
      for (std::size_t y = 0; y < height; ++y) {
        const std::size_t from = (cell.y + y) * native.width_px + static_cast<std::size_t>(cell.x);
        std::copy_n(native.rgbx.data() + 4 * from, 4 * width,
                    shown.picture.rgbx.data() + 4 * y * width);
      }
      for (std::size_t y = 0; y < 2 * height; ++y) {
        const std::uint8_t* from = samples.data() +
                                   (2 * static_cast<std::size_t>(cell.y) + y) * shot.width_px +
                                   2 * static_cast<std::size_t>(cell.x);
        for (std::size_t x = 0; x < 2 * width; ++x) {
          shown.silhouette[y * 2 * width + x] = from[x] >= 2 ? 1 : 0;
          if (from[x] > 0) shown.touched[y / 2 * width + x / 2] = 1;
        }
      }
    }
  }
  return all;
}

absl::Status Measurer::compare(const std::vector<Shown>& reference, const std::vector<Shown>& shown,
                               LevelReport& row) const {
  std::vector<double> overlap, psnr_db, ssim;
  for (std::size_t i = 0; i < reference.size(); ++i) {
    const Shown &a = reference[i], &b = shown[i];
    const auto common = render::silhouette_overlap(a.silhouette, b.silhouette);
    if (!common.ok()) return common.status();
    const auto near =
        render::pixels_near(a.touched, b.touched, a.picture.width_px, a.picture.height_px, kNearPx);
    if (!near.ok()) return near.status();
    const auto error = render::compare_pictures(b.picture, a.picture, *near);
    if (!error.ok()) return error.status();
    overlap.push_back(*common);
    psnr_db.push_back(std::min(error->psnr_db, kSamePsnrDb));
    ssim.push_back(error->ssim);
  }
  row.overlap = spread_of(overlap, report_.views.size());
  row.psnr_db = spread_of(psnr_db, report_.views.size());
  row.ssim = spread_of(ssim, report_.views.size());
  row.worst_picture =
      static_cast<std::uint32_t>(std::min_element(ssim.begin(), ssim.end()) - ssim.begin());
  return absl::OkStatus();
}

void Measurer::measure_distance(const LevelMesh& mesh, LevelReport& row) const {
  const SurfaceSamples samples(character_.position, mesh.triangles, options_.hausdorff_samples);
  float largest2 = 0.0F;
  for (std::uint32_t pose = 0; pose < posed_.size(); ++pose) {
    const std::vector<glm::vec3>& position = posed_[pose].position;
    const TriangleTree tree(position, mesh.triangles);
    const float before = largest2;
    largest2 = farthest2(samples, position, full_trees_[pose], largest2);
    largest2 = farthest2(*full_samples_, position, tree, largest2);
    if (largest2 > before) row.hausdorff_pose = pose;
  }
  row.hausdorff_m = std::sqrt(largest2);
}

absl::StatusOr<std::vector<Shown>> Measurer::judge(const LevelMesh& mesh,
                                                   const std::vector<Sheet>& sheets,
                                                   const std::vector<Shown>& reference,
                                                   LevelReport& row) {
  row.vertices = mesh.vertices;
  row.triangles = static_cast<std::uint32_t>(mesh.triangles.size());
  auto shown = show(mesh, sheets, kLevelSpecs[row.level].native_px);
  if (!shown.ok()) return shown.status();
  if (auto status = compare(reference, *shown, row); !status.ok()) return status;
  measure_distance(mesh, row);
  return shown;
}

absl::StatusOr<render::Picture> Measurer::portrait(const LevelMesh& mesh, int width, int height,
                                                   const glm::vec2& origin, float px_per_m) {
  render::Picture picture;
  const Figure figure{posed_.data(), 0.55F, 2.0F * origin};
  const Shot shot{kLowElevationRad, 2.0F * px_per_m, static_cast<std::uint32_t>(2 * width),
                  static_cast<std::uint32_t>(2 * height)};
  if (auto status = studio_->draw(mesh, {&figure, 1}, shot, picture); !status.ok()) return status;
  return halved(picture);
}

absl::StatusOr<render::Picture> Measurer::paint_levels() {
  constexpr int kFigurePx = 260, kPad = 14, kHead = 30, kTitle = 22;
  const float px_per_m = kFigurePx / character_.height_m;
  const Frame frame = frame_of(posed_[0], 0.55F, kLowElevationRad);
  const int width =
      std::max(static_cast<int>((frame.high.x - frame.low.x) * px_per_m) + 2 * kPad, 150);
  const int height = static_cast<int>((frame.high.y - frame.low.y) * px_per_m) + 2 * kPad;
  const glm::vec2 origin(
      0.5F * static_cast<float>(width) - 0.5F * (frame.low.x + frame.high.x) * px_per_m,
      static_cast<float>(kPad) - frame.low.y * px_per_m);
  std::vector<std::size_t> rows;
  for (std::size_t m = 0; m < meshes_.size(); ++m) {
    if (!meshes_[m].empty()) rows.push_back(m);
  }
  const auto columns = static_cast<int>(kLevelSpecs.size());
  Canvas canvas(
      static_cast<std::uint32_t>(columns * width),
      static_cast<std::uint32_t>(static_cast<int>(rows.size()) * (height + kHead + kTitle)),
      {250, 250, 249});
  for (std::size_t r = 0; r < rows.size(); ++r) {
    const int top = static_cast<int>(r) * (height + kHead + kTitle);
    canvas.write(method_name(kMethods[rows[r]]), {10.0F, static_cast<float>(top + kTitle - 4)},
                 11.0F, {20, 20, 20});
    for (int c = 0; c < columns; ++c) {
      const LevelMesh& mesh = meshes_[rows[r]][static_cast<std::size_t>(c)];
      auto picture = portrait(mesh, width, height, origin, px_per_m);
      if (!picture.ok()) return picture.status();
      canvas.put(*picture, c * width, top + kTitle + kHead);
      const std::string words = absl::StrCat(kLevelSpecs[static_cast<std::size_t>(c)].name, ": ",
                                             mesh.triangles.size(), " tri");
      canvas.write(words,
                   {static_cast<float>(c * width + 10), static_cast<float>(top + kTitle + 18)},
                   9.0F, {70, 70, 70});
    }
  }
  return canvas.picture();
}

/// Without most of the margin.
render::Picture trimmed(const render::Picture& picture) {
  constexpr std::uint32_t kCutPx = kMarginPx - 3;
  render::Picture middle;
  middle.width_px = picture.width_px - 2 * kCutPx;
  middle.height_px = picture.height_px - 2 * kCutPx;
  for (std::uint32_t y = 0; y < middle.height_px; ++y) {
    const std::uint8_t* row =
        picture.rgbx.data() +
        std::size_t{4} * ((y + kCutPx) * std::size_t{picture.width_px} + kCutPx);
    middle.rgbx.insert(middle.rgbx.end(), row, row + std::size_t{4} * middle.width_px);
  }
  return middle;
}

render::Picture Measurer::paint_worst() const {
  constexpr int kShownPx = 240, kHead = 44, kGap = 8;
  struct Column {
    int width, height, zoom;
  };
  std::vector<Column> columns;
  int width = kGap, height = 0;
  for (const Worst& worst : worst_) {
    const int zoom = std::max(1, kShownPx / static_cast<int>(kLevelSpecs[worst.level].native_px));
    columns.push_back({static_cast<int>(worst.pictures[0].width_px) * zoom,
                       static_cast<int>(worst.pictures[0].height_px) * zoom, zoom});
    width += std::max(columns.back().width, 170) + kGap;
    height = std::max(height, columns.back().height);
  }
  std::size_t rows = 1;
  for (const Worst& worst : worst_) rows = std::max(rows, worst.pictures.size());
  Canvas canvas(static_cast<std::uint32_t>(std::max(width, 1)),
                static_cast<std::uint32_t>(kHead + static_cast<int>(rows) * (height + 22)),
                {250, 250, 249});
  std::vector<std::string> names{"full mesh"};
  for (std::size_t m = 0; m < meshes_.size(); ++m) {
    if (!meshes_[m].empty()) names.emplace_back(method_name(kMethods[m]));
  }
  int x = kGap;
  for (std::size_t c = 0; c < worst_.size(); ++c) {
    const Worst& worst = worst_[c];
    const std::size_t line = worst.words.find('\n');
    canvas.write(worst.words.substr(0, line), {static_cast<float>(x), 17.0F}, 9.0F, {20, 20, 20});
    canvas.write(worst.words.substr(line + 1), {static_cast<float>(x), 34.0F}, 8.0F, {90, 90, 90});
    for (std::size_t r = 0; r < worst.pictures.size(); ++r) {
      const int y = kHead + static_cast<int>(r) * (height + 22);
      canvas.put(worst.pictures[r], x, y, columns[c].zoom);
      canvas.write(names[r], {static_cast<float>(x), static_cast<float>(y + height + 14)}, 8.0F,
                   {90, 90, 90});
    }
    x += std::max(columns[c].width, 170) + kGap;
  }
  return canvas.picture();
}

absl::StatusOr<Measured> Measurer::run() {
  const auto begin = std::chrono::steady_clock::now();
  report_.name = character_.name;
  report_.vertices = character_.vertex_count();
  report_.triangles = character_.triangle_count();
  report_.joints = character_.joint_count();
  report_.coarsest_vertices = character_.coarsest_count;
  report_.height_m = character_.height_m;
  report_.views = view_angles(options_.views);
  poses_ = choose_poses(character_, options_.poses);
  if (poses_.empty())
    return absl::InvalidArgumentError(
        absl::StrCat(character_.name, ": has no clip to be posed by"));
  for (const PoseId pose : poses_) {
    report_.poses.push_back(pose_name(character_, pose));
    posed_.push_back(pose_vertices(character_, pose));
  }
  auto studio = Studio::make(character_, seed_of(character_.name));
  if (!studio.ok()) return studio.status();
  studio_ = *std::move(studio);

  std::vector<std::uint32_t> targets;
  meshes_.resize(kMethods.size());
  for (const LevelSpec& spec : kLevelSpecs) {
    meshes_[0].push_back(level_mesh(character_, level_vertices(character_, spec.share)));
    targets.push_back(static_cast<std::uint32_t>(meshes_[0].back().triangles.size()));
  }
  full_ = meshes_[0][0];
  if (!options_.python.empty()) {
    auto rival =
        simplify_with_attributes(character_, targets, options_.python, options_.attribute_weights);
    if (!rival.ok()) return rival.status();
    meshes_[1] = *std::move(rival);
  }
  if (auto rival = simplify_plain(character_, targets); rival.ok()) meshes_[2] = *std::move(rival);

  full_samples_.emplace(character_.position, full_.triangles, options_.hausdorff_samples);
  for (const PosedVertices& posed : posed_)
    full_trees_.emplace_back(posed.position, full_.triangles);

  for (std::uint32_t level = 0; level < kLevelSpecs.size(); ++level) {
    const LevelSpec& spec = kLevelSpecs[level];
    if (level == 0) {
      LevelReport row;
      row.vertices = full_.vertices;
      row.triangles = static_cast<std::uint32_t>(full_.triangles.size());
      row.overlap.median = row.overlap.worst_pose = row.ssim.median = row.ssim.worst_pose = 1.0;
      row.psnr_db.median = row.psnr_db.worst_pose = kSamePsnrDb;
      report_.levels.push_back(row);
      continue;
    }
    const std::vector<Sheet> sheets = lay_out(spec.native_px);
    const auto reference = show(full_, sheets, spec.native_px);
    if (!reference.ok()) return reference.status();
    Worst worst{level, "", {}};
    std::uint32_t worst_picture = 0;  // ours; the others are shown in the same
    LevelReport ours;
    for (std::size_t m = 0; m < meshes_.size(); ++m) {
      if (meshes_[m].empty()) continue;
      LevelReport row;
      row.method = kMethods[m];
      row.level = level;
      auto shown = judge(meshes_[m][level], sheets, *reference, row);
      if (!shown.ok()) return shown.status();
      if (m == 0) {
        ours = row;
        worst_picture = row.worst_picture;
        const std::size_t views = report_.views.size();
        worst.words =
            absl::StrFormat("%s at %u px\n%s, view %u", spec.name, spec.native_px,
                            report_.poses[row.worst_picture / views], row.worst_picture % views);
        worst.pictures.push_back(trimmed((*reference)[row.worst_picture].picture));
      }
      worst.pictures.push_back(trimmed((*shown)[worst_picture].picture));
      report_.levels.push_back(row);
      if (m == 0 || !is_stuck(ours, row)) continue;
      LevelReport matched;
      matched.method = m == 1 ? Method::kAtAttributes : Method::kAtPlain;
      matched.level = level;
      const auto judged =
          judge(level_mesh_of(character_, row.triangles), sheets, *reference, matched);
      if (!judged.ok()) return judged.status();
      report_.levels.push_back(matched);
    }
    worst_.push_back(std::move(worst));
  }
  Measured measured;
  auto levels = paint_levels();
  if (!levels.ok()) return levels.status();
  measured.levels = *std::move(levels);
  measured.worst = paint_worst();
  std::stable_sort(report_.levels.begin(), report_.levels.end(),
                   [](const LevelReport& a, const LevelReport& b) { return a.method < b.method; });
  report_.report_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  measured.report = std::move(report_);
  return measured;
}

}  // namespace

const char* method_name(Method method) {
  switch (method) {
    case Method::kThrong:
      return "throng";
    case Method::kAttributes:
      return "meshoptimizer attributes";
    case Method::kPlain:
      return "meshoptimizer plain";
    case Method::kAtAttributes:
      return "throng with as many as attributes";
    case Method::kAtPlain:
      return "throng with as many as plain";
  }
  return "unknown";
}

absl::StatusOr<Measured> measure(const render::Character& character,
                                 const MeasureOptions& options) {
  return Measurer(character, options).run();
}

}  // namespace throng::simplify
