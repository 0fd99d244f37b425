#include "render/compute/cpu/speck_table.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "render/compute/cpu/kernels.hpp"
#include "render/compute/element/octahedral.hpp"
#include "render/compute/element/shared_pose.hpp"

namespace throng::render {
namespace {

constexpr std::uint32_t kPoints = 1024;
constexpr int kRows = 64;  // of the picture that slabs are averaged from
constexpr int kMostColumns = 128;

struct PosedPoint {
  glm::vec3 position, normal;  // model frame
  glm::vec3 tone[5];           // linear colour: what no tint dyes, then of each region
};

/// A picture before it is averaged: which point is seen in each cell, -1: none.
struct Cells {
  int columns;
  float x_low, y_low, side;  // in metres
  std::array<std::int32_t, kRows * kMostColumns> point;
  std::array<float, kRows * kMostColumns> depth;
};

struct View {
  glm::vec3 right, up, toward;  // of the picture
  glm::vec3 ahead;              // towards the eye on the ground
};

View view_of(std::uint32_t elevation, std::uint32_t azimuth) {
  const float e = element::kSpeckElevationRad[elevation];
  const float a = static_cast<float>(azimuth) * (6.2831853F / element::kSpeckAzimuths);
  const glm::vec3 ahead(std::cos(a), std::sin(a), 0.0F);
  const glm::vec3 z(0.0F, 0.0F, 1.0F);
  return {{-ahead.y, ahead.x, 0.0F},
          z * std::cos(e) - ahead * std::sin(e),
          ahead * std::cos(e) + z * std::sin(e),
          ahead};
}

/// Discs of the surface, nearest first, as splats are drawn.
void draw_cells(const std::vector<PosedPoint>& points, float radius_m, const View& view,
                Cells& cells) {
  glm::vec2 low(1e9F), high(-1e9F);
  for (const PosedPoint& point : points) {
    const glm::vec2 at(glm::dot(point.position, view.right), glm::dot(point.position, view.up));
    low = glm::min(low, at);
    high = glm::max(high, at);
  }
  cells.side = std::max(high.y - low.y, 1e-3F) / kRows;
  cells.side = std::max(cells.side, (high.x - low.x) / (kMostColumns - 1));
  cells.columns = std::clamp(static_cast<int>((high.x - low.x) / cells.side) + 1, 1, kMostColumns);
  cells.x_low = low.x;
  cells.y_low = low.y;
  const auto count = static_cast<std::size_t>(kRows * cells.columns);
  std::fill_n(cells.point.begin(), count, -1);
  std::fill_n(cells.depth.begin(), count, -1e9F);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const PosedPoint& point = points[i];
    const float facing = glm::dot(point.normal, view.toward);
    if (!(facing > 0.0F)) continue;
    const float steep = 1.0F / std::max(facing, 0.25F);
    const float slope_x = glm::dot(point.normal, view.right) * steep;
    const float slope_y = glm::dot(point.normal, view.up) * steep;
    const float x = glm::dot(point.position, view.right) - cells.x_low;
    const float y = glm::dot(point.position, view.up) - cells.y_low;
    const float depth = glm::dot(point.position, view.toward);
    const auto cell = [&](float at, int most) {
      return std::clamp(static_cast<int>(std::floor(at / cells.side)), 0, most);
    };
    const int row_low = cell(y - radius_m, kRows - 1), row_high = cell(y + radius_m, kRows - 1);
    const int column_low = cell(x - radius_m, cells.columns - 1);
    const int column_high = cell(x + radius_m, cells.columns - 1);
    for (int row = row_low; row <= row_high; ++row) {
      for (int column = column_low; column <= column_high; ++column) {
        const float dx = (static_cast<float>(column) + 0.5F) * cells.side - x;
        const float dy = (static_cast<float>(row) + 0.5F) * cells.side - y;
        const float fall = slope_x * dx + slope_y * dy;
        if (dx * dx + dy * dy + fall * fall > radius_m * radius_m) continue;
        const auto at = static_cast<std::size_t>(row * cells.columns + column);
        if (depth - fall <= cells.depth[at]) continue;
        cells.depth[at] = depth - fall;
        cells.point[at] = static_cast<std::int32_t>(i);
      }
    }
  }
}

/// What the cells of some rows add up to.
struct Sums {
  float count = 0.0F, x = 0.0F, squares = 0.0F;
  float facing[6] = {};
  glm::vec3 tone[5] = {};

  void add(const Sums& other) {
    count += other.count;
    x += other.x;
    squares += other.squares;
    for (int k = 0; k < 6; ++k) facing[k] += other.facing[k];
    for (int t = 0; t < 5; ++t) tone[t] += other.tone[t];
  }
};

/// Of rows [begin, end), in groups of equal area from the left to the right.
void sums_of(const std::vector<PosedPoint>& points, const Cells& cells, const View& view, int begin,
             int end, std::span<Sums> groups) {
  std::array<int, kMostColumns> filled{};
  int all = 0;
  for (int row = begin; row < end; ++row) {
    for (int column = 0; column < cells.columns; ++column) {
      if (cells.point[static_cast<std::size_t>(row * cells.columns + column)] < 0) continue;
      ++filled[static_cast<std::size_t>(column)];
      ++all;
    }
  }
  int before = 0;
  for (int column = 0; column < cells.columns; ++column) {
    const int here = filled[static_cast<std::size_t>(column)];
    if (here == 0) continue;
    const auto middle = static_cast<std::size_t>(2 * before + here);
    Sums& sums = groups[middle * groups.size() / static_cast<std::size_t>(2 * all)];
    before += here;
    const float x = cells.x_low + (static_cast<float>(column) + 0.5F) * cells.side;
    for (int row = begin; row < end; ++row) {
      const std::int32_t i = cells.point[static_cast<std::size_t>(row * cells.columns + column)];
      if (i < 0) continue;
      const PosedPoint& point = points[static_cast<std::size_t>(i)];
      sums.count += 1.0F;
      sums.x += x;
      sums.squares += x * x;
      const float n[3] = {glm::dot(point.normal, view.right), glm::dot(point.normal, view.ahead),
                          point.normal.z};
      for (int k = 0; k < 3; ++k) sums.facing[2 * k + (n[k] < 0.0F ? 1 : 0)] += n[k] * n[k];
      for (int t = 0; t < 5; ++t) sums.tone[t] += point.tone[t];
    }
  }
}

std::uint8_t byte_of(float share) {
  return static_cast<std::uint8_t>(std::clamp(share, 0.0F, 1.0F) * 255.0F + 0.5F);
}

/// Rows [begin, end) as one box of the same area, middle and spread.
SpeckSlab average(const Sums& sums, const Cells& cells, const View& view, float height_m, int begin,
                  int end) {
  SpeckSlab slab{};
  if (sums.count == 0.0F) return slab;
  const float middle = sums.x / sums.count;
  const float spread =
      std::max(sums.squares / sums.count - middle * middle, 0.0F) + cells.side * cells.side / 12.0F;
  const float half = std::sqrt(3.0F * spread);
  const float fill = sums.count * cells.side / (2.0F * half * static_cast<float>(end - begin));
  const float wider = half * std::max(fill, 1.0F);  // the area stays
  const auto length = [&](float metres) {
    return static_cast<std::int16_t>(
        std::lround(std::clamp(metres / height_m * SpeckSlab::kPerHeight, -32767.0F, 32767.0F)));
  };
  slab.low = length(middle - wider);
  slab.high = length(middle + wider);
  slab.fill = byte_of(std::min(fill, 1.0F));
  for (int k = 0; k < 6; ++k) slab.facing[k] = byte_of(sums.facing[k] / sums.count);
  for (int t = 0; t < 5; ++t) {
    for (int c = 0; c < 3; ++c) {
      slab.tone[3 * t + c] = byte_of(std::sqrt(sums.tone[t][c] / sums.count));
    }
  }
  // as shading darkens the feet
  const float above_m = cells.y_low + 0.5F * static_cast<float>(begin + end) * cells.side;
  const float rise = std::clamp((above_m / std::max(view.up.z, 0.3F) + 0.05F) / 0.8F, 0.0F, 1.0F);
  slab.open = byte_of(0.55F + 0.45F * rise * rise * (3.0F - 2.0F * rise));
  return slab;
}

/// The clip of a picture's pose; null: standing or walking.
const element::ClipRange* action_of(const element::Gait& gait, std::uint32_t pose) {
  if (pose <= element::kSpeckPhases) return nullptr;
  const std::uint32_t code = pose - element::kSpeckPhases - 1 + element::kSpeckFirstAction;
  return &gait.action[code - 1].clip;
}

void pose_points(const Kernels& kernels, const CharacterTable& table, std::uint32_t pose,
                 WorkerScratch& scratch, std::vector<PosedPoint>& points) {
  const SurfacePoints& surface = table.character->points;
  const auto count = std::min(kPoints, surface.count());
  element::InstanceState state{};
  state.placement = {1.0F, 0.0F, 1.0F};
  const std::uint32_t step = element::kPhases / element::kSpeckPhases;
  if (const element::ClipRange* clip = action_of(table.gait, pose)) {
    state.pose.a_frame0 = state.pose.a_frame1 = clip->first_frame + clip->frame_count / 4;
  } else {
    state.pose = element::shared_pose(
        table.gait, pose == 0 ? 0 : element::kPhases * element::kShares + (pose - 1) * step);
  }
  VisibleInstance instance{};
  instance.vertex_count = count;
  scratch.vertices.resize(count);
  kernels.pose_palette(table, state, table.character->vertex_count(), scratch.palette.data());
  kernels.skin(table.point.data(), instance, 0, scratch.palette.data(), scratch.vertices.data());
  // tones of the level that has no more points than are taken
  std::uint32_t first = 0;
  for (std::uint32_t n = surface.count(); (n >> 1) >= count && n > 1; n >>= 1) first += n;
  points.resize(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    const BatchVertex& vertex = scratch.vertices[i];
    const PointTone& tone = surface.tone[first + i];
    PosedPoint& point = points[i];
    point.position = vertex.position_relative;
    point.normal = element::unpack_octahedral(vertex.normal);
    glm::vec3 base;
    for (int c = 0; c < 3; ++c) {
      const float root = static_cast<float>((tone.base >> (10 * c)) & 1023U) / 1023.0F;
      base[c] = root * root;
    }
    float rest = 1.0F;
    for (int r = 0; r < 4; ++r) {
      const float share = static_cast<float>((tone.regions >> (8 * r)) & 255U) / 255.0F;
      point.tone[1 + r] = base * share;
      rest -= share;
    }
    point.tone[0] = base * std::max(rest, 0.0F);
  }
}

}  // namespace

std::shared_ptr<const SpeckTable> make_speck_table(const std::shared_ptr<const CastTable>& cast,
                                                   Machine machine,
                                                   std::vector<WorkerScratch>& scratch,
                                                   const SpeckTable* before) {
  if (before != nullptr) {
    if (const std::size_t kept = kept_members(*cast->cast, *before->cast->cast); kept > 0) {
      auto same = std::make_shared<SpeckTable>(*before);
      same->cast = cast;
      same->has_images.resize(kept);
      same->has_images.resize(cast->characters.size(), 0);
      return same;
    }
  }
  auto table = std::make_shared<SpeckTable>();
  table->cast = cast;
  // surroundings have no points, and may be thousands: pictures end with the last who has them
  std::size_t characters = 0;
  table->has_images.assign(cast->characters.size(), 0);
  for (std::size_t c = 0; c < cast->characters.size(); ++c) {
    if (cast->characters[c].point.empty()) continue;
    table->has_images[c] = 1;
    characters = c + 1;
  }
  table->image.resize(characters * element::kSpeckImages);
  table->slab.resize(table->image.size() * SpeckTable::kSlabs);
  for (WorkerScratch& own : scratch) own.palette.resize(cast->most_joints);
  machine.pool.run(characters * element::kSpeckPoses, [&](std::size_t job, unsigned worker) {
    const std::size_t c = job / element::kSpeckPoses;
    const auto pose = static_cast<std::uint32_t>(job % element::kSpeckPoses);
    if (table->has_images[c] == 0) return;
    const CharacterTable& character = cast->characters[c];
    const element::ClipRange* action = action_of(character.gait, pose);
    if (action != nullptr && action->frame_count == 0) return;  // nobody is told to
    const float height_m = std::max(character.character->height_m, 0.05F);
    std::vector<PosedPoint> points;
    pose_points(machine.kernels, character, pose, scratch[worker], points);
    // discs that leave no hole reach over the outline: so much smaller, a figure of 7 pixels covers
    // what its mesh does
    const float radius_m =
        0.92F * std::max(character.character->points.radius_m[points.size() - 1], 0.01F * height_m);
    const auto cells = std::make_unique<Cells>();
    for (std::uint32_t v = 0; v < element::kSpeckElevations * element::kSpeckAzimuths; ++v) {
      const View view = view_of(v / element::kSpeckAzimuths, v % element::kSpeckAzimuths);
      draw_cells(points, radius_m, view, *cells);
      const std::size_t image = job * element::kSpeckElevations * element::kSpeckAzimuths + v;
      SpeckSlab* slab = table->slab.data() + image * SpeckTable::kSlabs;
      SpeckImage& place = table->image[image];
      place = {1e9F, -1e9F, cells->y_low / height_m,
               (cells->y_low + cells->side * kRows) / height_m};
      // the finest level's, then of each coarser one what four or two of them add up to
      std::array<Sums, SpeckTable::kMostSlabs> sums{};
      for (std::uint32_t level = SpeckTable::kLevels; level-- > 0;) {
        const std::uint32_t shift = SpeckTable::column_shift(level);
        const int rows = kRows >> level;
        if (level + 1 == SpeckTable::kLevels) {
          for (int row = 0; row < 1 << level; ++row) {
            sums_of(points, *cells, view, row * rows, (row + 1) * rows,
                    std::span(sums).subspan(static_cast<std::size_t>(row) << shift, 1U << shift));
          }
        } else {
          const std::uint32_t finer = SpeckTable::column_shift(level + 1);
          for (std::uint32_t k = 0; k < 1U << (level + shift); ++k) {
            Sums sum;
            const std::uint32_t row = k >> shift, column = k & ((1U << shift) - 1U);
            for (std::uint32_t r = 2 * row; r < 2 * row + 2; ++r) {
              for (std::uint32_t c = 0; c < 1U << (finer - shift); ++c) {
                sum.add(sums[(r << finer) + (column << (finer - shift)) + c]);
              }
            }
            sums[k] = sum;
          }
        }
        for (std::uint32_t k = 0; k < 1U << (level + shift); ++k) {
          const int begin = static_cast<int>(k >> shift) * rows;
          SpeckSlab& made = slab[SpeckTable::first_slab(level) + k];
          made = average(sums[k], *cells, view, height_m, begin, begin + rows);
          if (made.fill == 0) continue;
          place.x_low = std::min(place.x_low, static_cast<float>(made.low) / SpeckSlab::kPerHeight);
          place.x_high =
              std::max(place.x_high, static_cast<float>(made.high) / SpeckSlab::kPerHeight);
        }
      }
      if (place.x_low > place.x_high) place.x_low = place.x_high = 0.0F;
    }
  });
  return table;
}

}  // namespace throng::render
