#include "render/raster/visibility/cpu/tile.hpp"

#include <gtest/gtest.h>

#include <hwy/highway.h>
#include <algorithm>
#include <cstring>
#include <memory>
#include <random>
#include <vector>

#include "render/raster/visibility/cpu/clip.hpp"
#include "render/raster/visibility/element/coverage.hpp"
#include "render/raster/visibility/element/word.hpp"

namespace throng::render::visibility {
namespace {

/// Triangles given straight on the sample grid.
struct Mesh {
  Projected projected;
  std::vector<std::uint32_t> indices;

  void add(std::int32_t x, std::int32_t y, float depth) {
    projected.x.push_back(x);
    projected.y.push_back(y);
    projected.depth.push_back(depth);
    projected.inverse_w.push_back(1.0F);
    indices.push_back(static_cast<std::uint32_t>(indices.size()));
  }
  InstanceTriangles triangles(bool double_sided = false) const {
    return {indices.data(), static_cast<std::uint32_t>(indices.size() / 3), 5, double_sided, false};
  }
};

std::unique_ptr<TilePlanes> drawn(const Mesh& mesh, int tile_x, int tile_y,
                                  bool double_sided = false) {
  auto planes = std::make_unique<TilePlanes>();
  clear_tile(*planes);
  TileCounters counters;
  draw_instance(mesh.triangles(double_sided), mesh.projected, nullptr, SampleGrid{}, tile_x, tile_y,
                *planes, counters);
  return planes;
}

/// The same by way of a list for a picture of 1280 x 720 samples.
std::unique_ptr<TilePlanes> list_drawn(const Mesh& mesh, int tile_x, int tile_y,
                                       bool double_sided) {
  auto planes = std::make_unique<TilePlanes>();
  clear_tile(*planes);
  TileCounters counters;
  TriangleList list;
  list_triangles(mesh.triangles(double_sided), mesh.projected, nullptr, {{}, 1280, 720}, list);
  draw_listed(list, {0, static_cast<std::uint32_t>(list.used)},
              {0, static_cast<std::uint32_t>(list.large.size())}, 5, double_sided, tile_x, tile_y,
              *planes, counters);
  return planes;
}

/// The plainest rasterizer: every sample of every triangle, 64-bit edge functions, top-left rule.
std::unique_ptr<TilePlanes> plainly_drawn(const Mesh& mesh, int tile_x, int tile_y,
                                          bool double_sided) {
  auto planes = std::make_unique<TilePlanes>();
  clear_tile(*planes);
  for (std::size_t t = 0; t < mesh.indices.size() / 3; ++t) {
    std::size_t v[3] = {mesh.indices[3 * t], mesh.indices[3 * t + 1], mesh.indices[3 * t + 2]};
    const auto x = [&](int k) { return std::int64_t{mesh.projected.x[v[k]]} - tile_x * 256; };
    const auto y = [&](int k) { return std::int64_t{mesh.projected.y[v[k]]} - tile_y * 256; };
    std::int64_t area = (x(2) - x(0)) * (y(1) - y(0)) - (x(1) - x(0)) * (y(2) - y(0));
    if (area < 0 && double_sided) {
      std::swap(v[1], v[2]);
      area = -area;
    }
    if (area <= 0) continue;
    const auto z = [&](int k) { return mesh.projected.depth[v[k]]; };
    const element::DepthPlane plane =
        element::depth_plane(static_cast<std::int32_t>(x(0)), static_cast<std::int32_t>(y(0)), z(0),
                             static_cast<std::int32_t>(x(1)), static_cast<std::int32_t>(y(1)), z(1),
                             static_cast<std::int32_t>(x(2)), static_cast<std::int32_t>(y(2)), z(2),
                             static_cast<float>(area));
    for (int j = 0; j < kTileSamples; ++j) {
      for (int i = 0; i < kTileSamples; ++i) {
        const std::int64_t px = i * 256 + 128, py = j * 256 + 128;
        bool inside = true;
        for (int k = 0; k < 3; ++k) {
          const int n = (k + 1) % 3;
          const std::int64_t dx = y(n) - y(k), dy = x(k) - x(n);
          const std::int64_t e = dx * (px - x(k)) + dy * (py - y(k));
          inside &= e > 0 || (e == 0 && (dx > 0 || (dx == 0 && dy > 0)));
        }
        if (!inside) continue;
        float depth = (plane.z0 + static_cast<float>(px - x(0)) * plane.dzdx) +
                      static_cast<float>(py - y(0)) * plane.dzdy;
        depth = std::min(std::max(depth, plane.low), plane.high);
        const std::uint32_t id =
            element::sample_id(element::SampleClass::kMesh, 5 + static_cast<std::uint32_t>(t) / 128,
                               static_cast<std::uint32_t>(t) % 128);
        const std::size_t at = sample_index(i, j);
        if (depth > planes->depth[at] || (depth == planes->depth[at] && id > planes->id[at])) {
          planes->depth[at] = depth;
          planes->id[at] = id;
        }
      }
    }
  }
  return planes;
}

::testing::AssertionResult same_planes(const TilePlanes& a, const TilePlanes& b) {
  for (int y = 0; y < kTileSamples; ++y) {
    for (int x = 0; x < kTileSamples; ++x) {
      const std::size_t at = sample_index(x, y);
      if (a.id[at] != b.id[at] || std::memcmp(&a.depth[at], &b.depth[at], 4) != 0) {
        return ::testing::AssertionFailure()
               << "sample " << x << ", " << y << ": id " << a.id[at] << " and " << b.id[at]
               << ", depth " << a.depth[at] << " and " << b.depth[at];
      }
    }
  }
  return ::testing::AssertionSuccess();
}

Mesh random_mesh(std::uint32_t seed, int count, int largest_units, int tile_x, int tile_y) {
  std::mt19937 random(seed);
  const auto within = [&](int low, int high) {
    return std::uniform_int_distribution<int>(low, high)(random);
  };
  Mesh mesh;
  for (int t = 0; t < count; ++t) {
    const int cx = tile_x * 256 + within(-4000, 64 * 256 + 4000);
    const int cy = tile_y * 256 + within(-4000, 64 * 256 + 4000);
    for (int k = 0; k < 3; ++k) {
      mesh.add(cx + within(-largest_units, largest_units),
               cy + within(-largest_units, largest_units),
               static_cast<float>(within(1, 1000)) * 0.001F);
    }
  }
  return mesh;
}

/// Calls `body` once for each instruction set this machine and build have.
template <typename Body>
void for_each_target(const Body& body) {
  const std::int64_t all = hwy::SupportedTargets();
  for (std::int64_t rest = all; rest != 0; rest &= rest - 1) {
    const std::int64_t target = rest & -rest;
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    body(hwy::TargetName(target));
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

TEST(TileTest, CoversTheSamplesOfThePlainestRasterizer) {
  for_each_target([](const char* target) {
    for (const bool double_sided : {false, true}) {
      for (const int size :
           {60, 300, 1500, 9000, 40'000, 1'000'000, element::kGuardUnits - 100'000}) {
        const Mesh mesh =
            random_mesh(static_cast<std::uint32_t>(size), size > 9000 ? 60 : 400, size, 640, 320);
        const auto plain = plainly_drawn(mesh, 640, 320, double_sided);
        EXPECT_TRUE(same_planes(*drawn(mesh, 640, 320, double_sided), *plain))
            << target << ", triangles of up to " << size << " sub-units";
        EXPECT_TRUE(same_planes(*list_drawn(mesh, 640, 320, double_sided), *plain))
            << target << ", listed triangles of up to " << size << " sub-units";
      }
    }
  });
}

TEST(TileTest, NeighboursShareEachSampleExactlyOnce) {
  // a fan around a point: every sample inside belongs to one triangle, so ids sum up without
  // overlap
  std::mt19937 random(3);
  for (int round = 0; round < 50; ++round) {
    const auto jitter = [&] { return std::uniform_int_distribution<int>(0, 255)(random); };
    const std::int32_t cx = 32 * 256 + jitter(), cy = 32 * 256 + jitter();
    const std::int32_t corner[5][2] = {
        {0, 0}, {64 * 256, 0}, {64 * 256, 64 * 256}, {0, 64 * 256}, {0, 0}};
    int covered = 0;
    for (int k = 0; k < 4; ++k) {
      Mesh mesh;
      mesh.add(cx, cy, 0.5F);
      mesh.add(corner[k + 1][0], corner[k + 1][1], 0.5F);
      mesh.add(corner[k][0], corner[k][1], 0.5F);
      const auto planes = drawn(mesh, 0, 0);
      covered += static_cast<int>(std::count_if(std::begin(planes->depth), std::end(planes->depth),
                                                [](float z) { return z > 0; }));
    }
    EXPECT_EQ(covered, kTileSamples * kTileSamples);
  }
}

TEST(TileTest, OrderOfTrianglesDoesNotMatter) {
  Mesh mesh = random_mesh(11, 300, 3000, 0, 0);
  for (float& depth : mesh.projected.depth) depth = 0.5F;  // ties everywhere: the larger id wins
  const auto forward = plainly_drawn(mesh, 0, 0, false);
  auto planes = std::make_unique<TilePlanes>();
  clear_tile(*planes);
  TileCounters counters;
  // in two halves, the second first; block numbers keep the ids
  const std::uint32_t half = 128;
  const InstanceTriangles second{mesh.indices.data() + 3 * half, 300 - half, 6, false, false};
  const InstanceTriangles first{mesh.indices.data(), half, 5, false, false};
  draw_instance(second, mesh.projected, nullptr, SampleGrid{}, 0, 0, *planes, counters);
  draw_instance(first, mesh.projected, nullptr, SampleGrid{}, 0, 0, *planes, counters);
  EXPECT_TRUE(same_planes(*planes, *forward));
}

TEST(TileTest, DegenerateAndBackFacingTrianglesCoverNothing) {
  Mesh mesh;
  const std::int32_t points[][6] = {
      {0, 0, 0, 0, 0, 0}, {0, 0, 5000, 5000, 10000, 10000}, {0, 0, 8000, 0, 4000, 8000} /* back */};
  for (const auto& p : points) {
    for (int k = 0; k < 3; ++k) mesh.add(p[2 * k], p[2 * k + 1], 0.5F);
  }
  const auto planes = drawn(mesh, 0, 0);
  EXPECT_EQ(*std::max_element(std::begin(planes->depth), std::end(planes->depth)), 0.0F);
}

TEST(TileTest, HiddenOnlyBehindEverySampleOfTheCells) {
  auto planes = std::make_unique<TilePlanes>();
  clear_tile(*planes);
  EXPECT_FALSE(hidden(*planes, 0, 0, 10, 10, 0.1F));
  std::fill(std::begin(planes->depth), std::end(planes->depth), 0.5F);
  planes->depth[sample_index(20, 20)] = 0.25F;
  update_cells(*planes);
  EXPECT_TRUE(hidden(*planes, 0, 0, 15, 15, 0.4F));
  EXPECT_FALSE(hidden(*planes, 0, 0, 15, 15, 0.5F)) << "an equal depth may win by its id";
  EXPECT_FALSE(hidden(*planes, 0, 0, 16, 16, 0.4F)) << "one sample is farther";
  EXPECT_TRUE(hidden(*planes, 0, 0, 63, 63, 0.2F));
}

TEST(TileTest, NoVerticesFallNowhere) {
  const Camera camera{.eye_world = {0, 0, 0}, .target_world = {0, 1, 0}};
  const SampleGrid grid{clip_from_relative(camera, {640, 360}), 1280, 720};
  Projected projected;
  const Footprint none = project_vertices(grid, nullptr, 7, 7, projected);
  EXPECT_GT(none.x_low, none.x_high);
  EXPECT_GT(none.y_low, none.y_high);
  EXPECT_FALSE(none.clipped);
}

TEST(TileTest, ProjectionGivesTheSameBytesOnEveryTarget) {
  std::mt19937 random(5);
  std::normal_distribution<float> normal;
  std::vector<BatchVertex> vertices(1003);
  for (BatchVertex& vertex : vertices) {
    vertex.position_relative =
        glm::vec3(normal(random), 4.0F + 3.0F * normal(random), normal(random));
  }
  const Camera camera{.eye_world = {0, 0, 0}, .target_world = {0, 1, 0}};
  const SampleGrid grid{clip_from_relative(camera, {640, 360}), 1280, 720};
  Projected reference;
  Footprint footprint{};
  bool first = true;
  for_each_target([&](const char* target) {
    Projected projected;
    projected.resize(vertices.size());
    const Footprint now = project_vertices(grid, vertices.data(), 0, vertices.size(), projected);
    if (first) {
      reference = projected;
      footprint = now;
      first = false;
      EXPECT_TRUE(now.clipped) << "some are behind the eye";
      return;
    }
    EXPECT_EQ(now.x_low, footprint.x_low) << target;
    EXPECT_EQ(now.depth_high, footprint.depth_high) << target;
    for (std::size_t i = 0; i < vertices.size(); ++i) {
      ASSERT_EQ(projected.x[i], reference.x[i]) << target << " vertex " << i;
      if (projected.x[i] == kNeedsClip) continue;
      ASSERT_EQ(projected.y[i], reference.y[i]) << target << " vertex " << i;
      ASSERT_EQ(projected.depth[i], reference.depth[i]) << target << " vertex " << i;
    }
  });
}

TEST(TileTest, ListedInstanceIsDrawnAsInEachTile) {
  // around the eye: triangles of all sizes, many of them cut or behind
  const Camera camera{.eye_world = {0, 0, 0}, .target_world = {0, 1, 0}};
  const SampleGrid grid{clip_from_relative(camera, {640, 360}), 1280, 720};
  std::mt19937 random(8);
  std::normal_distribution<float> normal;
  for (const float size : {0.02F, 0.3F, 4.0F}) {
    std::vector<BatchVertex> vertices;
    std::vector<std::uint32_t> indices;
    for (std::uint32_t i = 0; i < 1200; ++i) {
      const glm::vec3 centre =
          i % 3 == 0 ? glm::vec3(normal(random), 1.0F + 2.0F * normal(random), normal(random))
                     : vertices[i - i % 3].position_relative;
      vertices.push_back({});
      vertices.back().position_relative =
          centre + size * glm::vec3(normal(random), normal(random), normal(random));
      indices.push_back(i);
    }
    Projected projected;
    projected.resize(vertices.size());
    const Footprint whole = project_vertices(grid, vertices.data(), 0, vertices.size(), projected);
    ASSERT_TRUE(whole.clipped);
    const InstanceTriangles triangles{indices.data(), 400, 5, size > 1.0F, true};
    auto expected = std::make_unique<TilePlanes>(), planes = std::make_unique<TilePlanes>();
    TileCounters counters;
    for_each_target([&](const char* target) {
      TriangleList list;
      const Footprint footprint = list_triangles(triangles, projected, vertices.data(), grid, list);
      EXPECT_FALSE(footprint.clipped);
      float nearest = 0.0F;
      for (int tile_y = 0; tile_y < 720; tile_y += kTileSamples) {
        for (int tile_x = 0; tile_x < 1280; tile_x += kTileSamples) {
          clear_tile(*expected);
          clear_tile(*planes);
          draw_instance(triangles, projected, vertices.data(), grid, tile_x, tile_y, *expected,
                        counters);
          const bool is_near =
              footprint.x_low < tile_x + kTileSamples && footprint.x_high >= tile_x &&
              footprint.y_low < tile_y + kTileSamples && footprint.y_high >= tile_y;
          if (is_near) {
            draw_listed(list, {0, static_cast<std::uint32_t>(list.used)},
                        {0, static_cast<std::uint32_t>(list.large.size())}, 5,
                        triangles.double_sided, tile_x, tile_y, *planes, counters);
          }
          // the last row of tiles reaches beyond the picture, where a list has nothing
          const int rows = std::min(kTileSamples, grid.height - tile_y);
          for (int y = 0; y < rows; ++y) {
            for (int x = 0; x < kTileSamples; ++x) {
              const std::size_t at = sample_index(x, y);
              ASSERT_EQ(planes->id[at], expected->id[at])
                  << target << ", " << tile_x + x << ", " << tile_y + y;
              ASSERT_EQ(planes->depth[at], expected->depth[at]) << target;
              nearest = std::max(nearest, expected->depth[at]);
            }
          }
        }
      }
      EXPECT_GT(nearest, 0.0F);
      EXPECT_LE(nearest, footprint.depth_high);
    });
  }
}

TEST(TileTest, SharedMeshIsDrawnAsItsOwnVertices) {
  std::mt19937 random(9);
  std::normal_distribution<float> normal;
  const Camera camera{.eye_world = {0, 0, 0}, .target_world = {0, 1, 0}};
  const SampleGrid grid{clip_from_relative(camera, {640, 360}), 1280, 720};
  for (const std::uint32_t vertex_count : {5U, 27U, 32U, 33U, 64U, 65U, 300U, 1024U}) {
    const std::uint32_t stride = (vertex_count + 15) / 16 * 16 + 16;
    struct alignas(64) Line {
      float values[16];
    };
    std::vector<Line> posed(4 * stride / 16);
    float* column = posed[0].values;
    glm::vec3 low(1e9F), high(-1e9F);
    for (std::uint32_t i = 0; i < stride; ++i) {
      for (std::uint32_t k = 0; k < 3; ++k) {
        column[k * stride + i] =
            i < vertex_count ? 0.4F * normal(random) : column[k * stride + vertex_count - 1];
        low[static_cast<int>(k)] = std::min(low[static_cast<int>(k)], column[k * stride + i]);
        high[static_cast<int>(k)] = std::max(high[static_cast<int>(k)], column[k * stride + i]);
      }
    }
    std::vector<std::uint32_t> corners, indices;
    for (std::uint32_t t = 0; t < 2 * vertex_count + 3; ++t) {
      std::uint32_t word = 0;
      for (int k = 0; k < 3; ++k) {
        const std::uint32_t corner = static_cast<std::uint32_t>(random()) % vertex_count;
        word |= corner << (10 * k);
        indices.push_back(corner);
      }
      corners.push_back(word);
    }
    const auto count = static_cast<std::uint32_t>(corners.size());
    corners.resize(count + 16, 0);
    const SharedTriangles shared{column, stride, vertex_count,         corners.data(),
                                 count,  5,      {0.3F, 25.0F, -0.5F}, 0.9F,
                                 0.5F,   1.03F,  vertex_count % 2 == 0};
    std::vector<BatchVertex> vertices(vertex_count);
    for (std::uint32_t i = 0; i < vertex_count; ++i) {
      const float x = column[i], y = column[stride + i], z = column[2 * stride + i];
      vertices[i].position_relative =
          shared.feet_relative + glm::vec3(x * shared.cosine_scale - y * shared.sine_scale,
                                           x * shared.sine_scale + y * shared.cosine_scale,
                                           z * shared.scale);
    }
    Projected projected;
    projected.resize(vertex_count);
    const Footprint exact = project_vertices(grid, vertices.data(), 0, vertex_count, projected);
    const Footprint box = project_box(grid, low, high, shared);
    EXPECT_LE(box.x_low, exact.x_low);
    EXPECT_LE(box.y_low, exact.y_low);
    EXPECT_GE(box.x_high, exact.x_high);
    EXPECT_GE(box.y_high, exact.y_high);
    EXPECT_GE(box.depth_high, exact.depth_high);
    const InstanceTriangles own{indices.data(), count, 5, shared.double_sided, false};
    TileCounters counters;
    auto scratch = std::make_unique<SharedScratch>();
    auto expected = std::make_unique<TilePlanes>(), planes = std::make_unique<TilePlanes>();
    int covered = 0;
    for (int tile_y = 256; tile_y <= 448; tile_y += 64) {
      for (int tile_x = 576; tile_x <= 704; tile_x += 64) {
        clear_tile(*expected);
        draw_instance(own, projected, vertices.data(), grid, tile_x, tile_y, *expected, counters);
        covered += static_cast<int>(std::count_if(std::begin(expected->id), std::end(expected->id),
                                                  [](std::uint32_t id) { return id != 0; }));
        for_each_target([&](const char* target) {
          clear_tile(*planes);
          draw_shared(shared, grid, tile_x, tile_y, *scratch, *planes, counters);
          EXPECT_TRUE(same_planes(*planes, *expected))
              << target << ", " << vertex_count << " vertices, tile " << tile_x << ", " << tile_y;
        });
      }
    }
    EXPECT_GT(covered, 100);
  }
}

TEST(ClipTest, TriangleBehindTheEyeIsGone) {
  const Camera camera{.eye_world = {0, 0, 0}, .target_world = {0, 1, 0}};
  const SampleGrid grid{clip_from_relative(camera, {640, 360}), 1280, 720};
  const auto clip_space = [&](glm::vec3 p) { return to_clip(grid.clip_from_relative, p); };
  SnappedVertex polygon[kMaxClippedCorners];
  const glm::vec4 behind[3] = {clip_space({0, -1, 0}), clip_space({1, -1, 0}),
                               clip_space({0, -1, 1})};
  EXPECT_EQ(clip_triangle(grid, behind, polygon), 0);
  const glm::vec4 crossing[3] = {clip_space({0, 5, 0}), clip_space({1, -5, 0}),
                                 clip_space({-1, -5, 0})};
  EXPECT_GE(clip_triangle(grid, crossing, polygon), 3);
  const glm::vec4 wild[3] = {glm::vec4(NAN), clip_space({1, 5, 0}), clip_space({0, 5, 1})};
  EXPECT_EQ(clip_triangle(grid, wild, polygon), 0);
}

}  // namespace
}  // namespace throng::render::visibility
