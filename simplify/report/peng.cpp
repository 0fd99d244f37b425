#include "simplify/report/peng.hpp"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "simplify/bake/bake.hpp"
#include "simplify/builtin/builtin.hpp"
#include "simplify/report/canvas.hpp"
#include "simplify/report/hausdorff.hpp"
#include "simplify/report/studio.hpp"

namespace throng::simplify {
namespace {

constexpr std::uint32_t kFigure2Triangles = 300;
constexpr std::uint32_t kFigure3Triangles[] = {2620, 655, 388, 276, 190};
constexpr std::uint32_t kPoses = 6;
constexpr std::uint32_t kSamples = 4000;
constexpr float kElevationRad = 0.09F, kTurnRad = 0.6F;
constexpr int kFigurePx = 250, kPadPx = 14, kLabelPx = 44, kHeadPx = 12;
constexpr int kNarrowestPx = 150;
const glm::u8vec3 kPaper(250, 250, 249), kInk(30, 30, 30), kPale(95, 95, 95);

absl::StatusOr<render::Character> bake_peng(const SourceCharacter& source, bool bind_pose_only) {
  BakeOptions options;
  options.criterion = Criterion::kPeng2011;
  options.bind_pose_only = bind_pose_only;
  auto baked = bake(source, options);
  if (!baked.ok()) return baked.status();
  return render::make_character(std::move(baked->character));
}

/// From the full mesh to a level, in one pose.
struct Distance {
  double mean_mm = 0.0;  // root of the mean square
  double largest_mm = 0.0;
};
Distance distance_of(const render::Character& character, const LevelMesh& mesh,
                     const PosedVertices& posed) {
  const LevelMesh full = level_mesh(character, character.vertex_count());
  const SurfaceSamples samples(character.position, full.triangles, kSamples);
  const TriangleTree tree(posed.position, mesh.triangles);
  double sum2 = 0.0, largest2 = 0.0;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const auto one2 = static_cast<double>(tree.distance2(samples.at(i, posed.position)));
    sum2 += one2;
    largest2 = std::max(largest2, one2);
  }
  return {1000.0 * std::sqrt(sum2 / static_cast<double>(samples.size())),
          1000.0 * std::sqrt(largest2)};
}

struct Place {
  int width, height;
  glm::vec2 origin;
  float px_per_m;
};

Place place_of(const render::Character& character, const std::vector<const PosedVertices*>& poses) {
  Frame all{glm::vec2(HUGE_VALF), glm::vec2(-HUGE_VALF)};
  for (const PosedVertices* posed : poses) {
    const Frame frame = frame_of(*posed, kTurnRad, kElevationRad);
    all.low = glm::min(all.low, frame.low);
    all.high = glm::max(all.high, frame.high);
  }
  const float px_per_m = kFigurePx / character.height_m;
  const glm::vec2 size = (all.high - all.low) * px_per_m;
  const int width = std::max(static_cast<int>(size.x) + 2 * kPadPx, kNarrowestPx);
  return {width, static_cast<int>(size.y) + 2 * kPadPx,
          glm::vec2(0.5F * (static_cast<float>(width) - size.x), kPadPx) - all.low * px_per_m,
          px_per_m};
}

absl::Status put_figure(Studio& studio, const LevelMesh& mesh, const PosedVertices& posed,
                        const Place& place, int x, int y, Canvas& canvas) {
  render::Picture picture;
  const Figure figure{&posed, kTurnRad, 2.0F * place.origin};
  const Shot shot{kElevationRad, 2.0F * place.px_per_m, static_cast<std::uint32_t>(2 * place.width),
                  static_cast<std::uint32_t>(2 * place.height)};
  if (auto status = studio.draw(mesh, {&figure, 1}, shot, picture); !status.ok()) return status;
  canvas.put(halved(picture), x, y);
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<PengFigures> paint_peng2011(const std::string& builtin_name,
                                           const std::string& poses_png,
                                           const std::string& levels_png) {
  const std::vector<std::string> names = builtin::builtin_names();
  if (std::find(names.begin(), names.end(), builtin_name) == names.end())
    return absl::InvalidArgumentError(absl::StrCat(builtin_name, ": is not in the built-in cast"));
  const SourceCharacter source = builtin::make_builtin(builtin_name);
  const auto bind = bake_peng(source, true);
  if (!bind.ok()) return bind.status();
  const auto all = bake_peng(source, false);
  if (!all.ok()) return all.status();

  // vertices come in another order from each bake, poses are the same
  const std::vector<PoseId> poses = choose_poses(*all, kPoses);
  std::vector<PosedVertices> bind_posed, all_posed;
  std::vector<const PosedVertices*> shown_poses;
  for (const PoseId pose : poses) {
    bind_posed.push_back(pose_vertices(*bind, pose));
    all_posed.push_back(pose_vertices(*all, pose));
  }
  for (const PosedVertices& posed : all_posed) shown_poses.push_back(&posed);
  auto bind_studio = Studio::make(*bind, seed_of(builtin_name));
  if (!bind_studio.ok()) return bind_studio.status();
  auto all_studio = Studio::make(*all, seed_of(builtin_name));
  if (!all_studio.ok()) return all_studio.status();

  PengFigures figures;
  // figure 2: rows full mesh, bind pose only, all frames
  {
    const LevelMesh full = level_mesh(*all, all->vertex_count());
    const LevelMesh bind_level = level_mesh_of(*bind, kFigure2Triangles);
    const LevelMesh all_level = level_mesh_of(*all, kFigure2Triangles);
    const Place place = place_of(*all, shown_poses);
    const int row = place.height + kLabelPx;
    const auto columns = static_cast<int>(poses.size());
    Canvas canvas(static_cast<std::uint32_t>(columns * place.width),
                  static_cast<std::uint32_t>(3 * row + kHeadPx), kPaper);
    struct Row {
      std::string title;
      const LevelMesh& mesh;
      const render::Character& character;
      const std::vector<PosedVertices>& posed;
      Studio& studio;
      double mean_mm = 0.0, worst_mm = 0.0, largest_mm = 0.0;
    };
    Row rows[] = {
        {absl::StrCat("full mesh, ", full.triangles.size(), " triangles"), full, *all, all_posed,
         **all_studio},
        {absl::StrCat("cost in the bind pose only, ", bind_level.triangles.size(), " triangles"),
         bind_level, *bind, bind_posed, **bind_studio},
        {absl::StrCat("mean cost over all frames, ", all_level.triangles.size(), " triangles"),
         all_level, *all, all_posed, **all_studio}};
    for (int r = 0; r < 3; ++r) {
      Row& one = rows[r];
      const int top = kHeadPx + r * row;
      canvas.write(one.title, {8.0F, static_cast<float>(top + 14)}, 11.0F, kInk);
      for (int c = 0; c < columns; ++c) {
        const auto i = static_cast<std::size_t>(c);
        const Distance distance = distance_of(one.character, one.mesh, one.posed[i]);
        one.mean_mm += distance.mean_mm / columns;
        one.worst_mm = std::max(one.worst_mm, distance.mean_mm);
        one.largest_mm = std::max(one.largest_mm, distance.largest_mm);
        const std::string words = r == 0 ? pose_name(*all, poses[i])
                                         : absl::StrFormat("%.1f mm, at most %.0f",
                                                           distance.mean_mm, distance.largest_mm);
        canvas.write(words, {static_cast<float>(c * place.width + 8), static_cast<float>(top + 35)},
                     8.5F, kPale);
        const auto status = put_figure(one.studio, one.mesh, one.posed[i], place, c * place.width,
                                       top + kLabelPx, canvas);
        if (!status.ok()) return status;
      }
    }
    figures.poses = canvas.picture();
    absl::StrAppendFormat(
        &figures.html,
        "<h2>Peng et al. 2011</h2>\n<p>The published criterion (<code>--criterion peng2011</code>) "
        "with %s of the built-in cast. As their figure 2: cost in the bind pose only (%u "
        "triangles) "
        "against the mean of all frames of all clips (%u triangles; 300 wanted). Distance of the "
        "full "
        "mesh to either over the %u poses shown, root mean square: %.1f mm against %.1f mm in the "
        "mean of the poses, %.1f mm against %.1f mm in the worst; largest: %.0f mm against %.0f "
        "mm.</p>\n"
        "<figure><img src=\"%s\" alt=\"bind pose against all frames\" loading=\"lazy\"></figure>\n",
        builtin_name, bind_level.triangles.size(), all_level.triangles.size(), poses.size(),
        rows[1].mean_mm, rows[2].mean_mm, rows[1].worst_mm, rows[2].worst_mm, rows[1].largest_mm,
        rows[2].largest_mm, poses_png);
  }
  // figure 3
  {
    const Place place = place_of(*all, {&all_posed[0]});
    const auto columns = static_cast<int>(std::size(kFigure3Triangles));
    const int width = place.width;
    Canvas canvas(static_cast<std::uint32_t>(columns * width),
                  static_cast<std::uint32_t>(place.height + 28), kPaper);
    std::string reached;
    for (int c = 0; c < columns; ++c) {
      const LevelMesh mesh = level_mesh_of(*all, kFigure3Triangles[c]);
      canvas.write(absl::StrCat(mesh.triangles.size(), " tri"),
                   {static_cast<float>(c * width + 8), 17.0F}, 10.0F, kInk);
      const auto status =
          put_figure(**all_studio, mesh, all_posed[0], place, c * width, 28, canvas);
      if (!status.ok()) return status;
      absl::StrAppend(&reached, c == 0 ? "" : ", ", mesh.triangles.size());
    }
    figures.levels = canvas.picture();
    absl::StrAppendFormat(
        &figures.html,
        "<p>As their figure 3, levels of one character: 2620, 655, 388, 276 and 190 triangles "
        "there, %s here. "
        "The rule ends at %u vertices, %u triangles: its fixed vertices (texture corners) "
        "stay.</p>\n"
        "<figure><img src=\"%s\" alt=\"levels by the published criterion\" "
        "loading=\"lazy\"></figure>\n",
        reached, all->coarsest_count, all->triangle_count_at[all->coarsest_count], levels_png);
  }
  return figures;
}

}  // namespace throng::simplify
