// The visibility words of the CUDA kernels, compiled for the processor, against the processor's
// tiles: the same bits for triangles of every size, in front of the eye and around it, with holes.
#include <cuda_runtime_api.h>
#include <gtest/gtest.h>

#include <cstring>
#include <random>

#include "render/raster/visibility/cpu/tile.hpp"
#include "render/raster/visibility/cuda/launch.hpp"
#include "render/raster/visibility/element/word.hpp"
#include "support/raster_scene.hpp"
#include "throng/render/asset.hpp"

namespace throng::render::visibility {
namespace {

namespace kernels = throng::render::visibility::cuda;

struct Case {
  test::RasterScene scene;
  std::vector<std::uint8_t> flags;  // of the one character's triangles
  Camera camera = {.eye_world = {0, 0, 0}, .target_world = {0, 1, 0}};
  Viewport viewport = {150, 90};
  bool double_sided = false;
};

/// A checkerboard of holes with three mip levels.
std::vector<std::uint32_t> checkers() {
  std::vector<std::uint32_t> texels;
  for (std::uint32_t side = 16; side >= 4; side /= 2) {
    for (std::uint32_t i = 0; i < side * side; ++i) {
      const bool solid = (i / side / 2 + i % side / 2) % 2 == 0;
      texels.push_back(solid ? 0xff808080U : 0x00808080U);
    }
  }
  return texels;
}

std::vector<kernels::Word> by_processor(const Case& c, const Cutout& cutout) {
  const FrameGeometry geometry = c.scene.geometry();
  const SampleGrid grid{clip_from_relative(c.camera, c.viewport),
                        static_cast<std::int32_t>(2 * c.viewport.width_px),
                        static_cast<std::int32_t>(2 * c.viewport.height_px)};
  Projected projected;
  projected.resize(geometry.vertices.size());
  const auto width = static_cast<int>(2 * c.viewport.width_px);
  const auto height = static_cast<int>(2 * c.viewport.height_px);
  std::vector<kernels::Word> words(static_cast<std::size_t>(width) * height, 0);
  auto planes = std::make_unique<TilePlanes>();
  TileCounters counters;
  for (int y = 0; y < height; y += kTileSamples) {
    for (int x = 0; x < width; x += kTileSamples) {
      clear_tile(*planes);
      std::uint32_t first_block = 0;
      for (std::size_t i = 0; i < geometry.instances.size(); ++i) {
        const Footprint f =
            project_vertices(grid, geometry.vertices.data(), geometry.vertex_offset[i],
                             geometry.vertex_offset[i + 1], projected);
        const std::uint32_t first = geometry.triangle_offset[i];
        const std::uint32_t count = geometry.triangle_offset[i + 1] - first;
        draw_instance({geometry.indices.data() + 3 * std::size_t{first}, count, first_block,
                       c.double_sided, f.clipped, c.flags.empty() ? nullptr : &cutout},
                      projected, geometry.vertices.data(), grid, x, y, *planes, counters);
        first_block += (count + element::kBlockTriangles - 1) / element::kBlockTriangles;
      }
      for (int j = 0; j < kTileSamples && y + j < height; ++j) {
        for (int i = 0; i < kTileSamples && x + i < width; ++i) {
          const std::size_t at = sample_index(i, j);
          if (!(planes->depth[at] > 0.0F)) continue;
          words[static_cast<std::size_t>(y + j) * width + x + i] =
              kernels::Word{element::float_bits(planes->depth[at])} << 32 | planes->id[at];
        }
      }
    }
  }
  return words;
}

std::vector<kernels::Word> by_kernels(const Case& c, const std::vector<std::uint32_t>& texels) {
  const FrameGeometry geometry = c.scene.geometry();
  kernels::RasterCharacter character;
  character.texture = {0, 16, 16, 3, -1, 1, 1, 0};
  if (c.double_sided) character.flags |= kernels::RasterCharacter::kDoubleSided;
  if (!c.flags.empty()) character.flags |= kernels::RasterCharacter::kHoles;
  kernels::RasterJob job;
  job.cast.character = &character;
  job.cast.texels = texels.data();
  job.cast.triangle_flags = c.flags.data();
  job.cast.first_surrounding = 1;
  job.scene = {};
  job.width_px = c.viewport.width_px;
  job.height_px = c.viewport.height_px;
  job.grid = {clip_from_relative(c.camera, c.viewport),
              static_cast<std::int32_t>(2 * c.viewport.width_px),
              static_cast<std::int32_t>(2 * c.viewport.height_px)};
  job.word_blocks_x = (2 * job.width_px + 3) / 4;
  job.count = static_cast<std::uint32_t>(geometry.instances.size());
  job.vertices_total = static_cast<std::uint32_t>(geometry.vertices.size());
  job.triangles_total = geometry.triangle_offset.back();
  job.instance = geometry.instances.data();
  job.vertex_offset = geometry.vertex_offset.data();
  job.triangle_offset = geometry.triangle_offset.data();
  job.vertices = geometry.vertices.data();
  job.indices = geometry.indices.data();
  std::vector<InstanceShade> shade(job.count);
  std::vector<std::uint32_t> block_count(job.count + 1), first_block(job.count + 1);
  const std::uint32_t most_blocks = job.triangles_total / element::kBlockTriangles + job.count;
  std::vector<std::uint32_t> block_instance(most_blocks), special(job.triangles_total);
  std::vector<element::SnappedVertex> projected(job.vertices_total);
  std::vector<kernels::LargeTriangle> large(kernels::kLargeRoom);
  std::vector<glm::uvec2> tiles(kernels::kTileRoom);
  kernels::RasterCounts counts;
  std::vector<kernels::Word> words(std::size_t{16} * job.word_blocks_x *
                                   ((2 * job.height_px + 3) / 4));
  job.shade = shade.data();
  job.block_count = block_count.data();
  job.first_block = first_block.data();
  job.block_instance = block_instance.data();
  job.projected = projected.data();
  job.special = special.data();
  job.large = large.data();
  job.tiles = tiles.data();
  job.counts = &counts;
  job.words = words.data();
  EXPECT_EQ(kernels::launch_prepare(job, nullptr), cudaSuccess);
  for (std::uint32_t i = 0; i < job.count; ++i)
    first_block[i + 1] = first_block[i] + block_count[i];
  EXPECT_EQ(kernels::launch_raster(job, most_blocks, nullptr), cudaSuccess);
  EXPECT_EQ(kernels::launch_large(job, nullptr), cudaSuccess);
  std::vector<kernels::Word> rows;
  for (std::uint32_t y = 0; y < 2 * job.height_px; ++y) {
    for (std::uint32_t x = 0; x < 2 * job.width_px; ++x) {
      rows.push_back(words[kernels::word_index(job.word_blocks_x, x, y)]);
    }
  }
  return rows;
}

/// Share of samples that show something.
double expect_same_words(const Case& c) {
  const std::vector<std::uint32_t> texels = checkers();
  const Cutout cutout{c.flags.data(), texels.data(), 16, 16, 3};
  const std::vector<kernels::Word> expected = by_processor(c, cutout);
  const std::vector<kernels::Word> actual = by_kernels(c, texels);
  EXPECT_EQ(expected.size(), actual.size());
  std::size_t different = 0, covered = 0;
  for (std::size_t i = 0; i < expected.size() && i < actual.size(); ++i) {
    covered += expected[i] != 0;
    if (expected[i] == actual[i]) continue;
    if (different++ == 0) {
      ADD_FAILURE() << "sample " << i % (2 * c.viewport.width_px) << ", "
                    << i / (2 * c.viewport.width_px) << ": " << std::hex << expected[i] << " and "
                    << actual[i];
    }
  }
  EXPECT_EQ(different, 0U);
  return static_cast<double>(covered) / static_cast<double>(expected.size());
}

/// Triangles of sides up to `size_m` around points in front of the eye, or on all its sides.
test::RasterScene scattered(std::uint32_t seed, int instances, int triangles, float size_m,
                            bool around) {
  std::mt19937 random(seed);
  const auto uniform = [&](float low, float high) {
    return low + (high - low) * static_cast<float>(random() >> 8) * (1.0F / 16777216.0F);
  };
  test::RasterScene scene;
  for (int i = 0; i < instances; ++i) {
    scene.begin_instance({0, 0, 0});
    for (int t = 0; t < triangles; ++t) {
      const float y = around ? uniform(-4, 6) : uniform(2, 9);
      const glm::vec3 centre(uniform(-1, 1) * (std::abs(y) + 1), y,
                             uniform(-0.6F, 0.6F) * (std::abs(y) + 1));
      std::uint32_t v[3];
      for (std::uint32_t& one : v) {
        one = scene.add_vertex(
            centre + size_m * glm::vec3(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)), {0, 0, 1},
            {uniform(0, 1), uniform(0, 1)});
      }
      scene.add_triangle(v[0], v[1], v[2]);
    }
  }
  return scene;
}

TEST(CudaWordsTest, AreTheProcessorsForTrianglesOfEverySize) {
  for (const float size_m : {0.005F, 0.03F, 0.2F, 1.0F, 8.0F, 300.0F}) {
    for (const bool double_sided : {false, true}) {
      SCOPED_TRACE(testing::Message() << size_m << " m, " << double_sided);
      Case c;
      c.scene = scattered(static_cast<std::uint32_t>(1000 * size_m), 2, 140, size_m, false);
      c.double_sided = double_sided;
      EXPECT_GE(expect_same_words(c), size_m < 0.1F ? 0.0 : 0.005);
    }
  }
}

TEST(CudaWordsTest, AreTheProcessorsAroundTheEye) {
  for (const float size_m : {0.1F, 2.0F, 50.0F}) {
    Case c;
    c.scene = scattered(7, 2, 140, size_m, true);
    c.double_sided = true;
    EXPECT_GT(expect_same_words(c), 0.01);
  }
}

TEST(CudaWordsTest, AreTheProcessorsWithHoles) {
  for (const float size_m : {0.02F, 0.5F, 3.0F}) {
    Case c;
    c.scene = scattered(9, 1, 200, size_m, size_m > 1.0F);
    c.flags.assign(200, kTriangleAlphaCutout);
    for (std::size_t t = 0; t < c.flags.size(); t += 3) c.flags[t] = 0;
    c.double_sided = true;
    EXPECT_GE(expect_same_words(c), size_m < 0.1F ? 0.0 : 0.005);
  }
}

TEST(CudaWordsTest, AreTheProcessorsOfPeople) {
  Case c;
  c.camera = {.eye_world = {0, -5, 2.0}, .target_world = {0, 3, 1}};
  c.scene = test::mannequin_crowd(c.camera, 9, 0.9F, 5);
  EXPECT_GT(expect_same_words(c), 0.05);
}

TEST(CudaWordsTest, NobodyIsNothing) {
  EXPECT_EQ(kernels::launch_raster(kernels::RasterJob(), 0, nullptr), cudaSuccess);
}

}  // namespace
}  // namespace throng::render::visibility
