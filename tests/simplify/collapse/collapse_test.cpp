#include "simplify/collapse/collapse.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>

#include "simplify/bake/bake.hpp"
#include "simplify/collapse/levels.hpp"
#include "support/data_dir.hpp"
#include "support/source_shapes.hpp"
#include "support/tiny_character.hpp"

namespace throng::simplify {
namespace {

render::Character baked(const SourceCharacter& source, const BakeOptions& options = {}) {
  auto result = bake(source, options);
  EXPECT_TRUE(result.ok()) << result.status();
  auto character = render::make_character(std::move(result->character));
  EXPECT_TRUE(character.ok()) << character.status();
  return *std::move(character);
}

TEST(CollapseTest, EveryLegalLevelIsWholeAndClosed) {
  test::TubeOptions tube;
  tube.bulge = 0.8F;
  tube.has_elbow = true;
  for (const SourceCharacter& source :
       {test::make_tube(tube), test::make_cube(), test::make_tube()}) {
    const render::Character character = baked(source);
    for (const std::uint32_t n : test::legal_counts(character)) {
      test::expect_whole(character, n);
      test::expect_closed(character, n);
    }
    EXPECT_TRUE(check_levels(character).ok());
  }
}

TEST(CollapseTest, ReachesTwentyEightVertices) {
  test::TubeOptions tube;
  tube.columns = 32;
  tube.rings = 60;
  tube.has_elbow = true;
  const render::Character character = baked(test::make_tube(tube));
  EXPECT_GT(character.vertex_count(), 1900U);
  EXPECT_LE(character.coarsest_count, 28U);
  EXPECT_GE(character.coarsest_count, 8U);
}

TEST(CollapseTest, FullLevelIsTheSourceMesh) {
  const SourceCharacter tube = test::make_tube();
  const render::Character character = baked(tube);
  EXPECT_EQ(character.triangle_count_at[character.vertex_count()], tube.triangles.size());
  EXPECT_EQ(character.triangle_count(), tube.triangles.size());
}

TEST(CollapseTest, ErrorNeverFallsTowardsCoarserLevels) {
  const render::Character character = baked(test::make_tube());
  for (std::uint32_t i = 1; i < character.vertex_count(); ++i) {
    EXPECT_GE(character.collapse_error_m[i - 1], character.collapse_error_m[i]) << i;
  }
}

TEST(CollapseTest, SameInputGivesTheSameOrder) {
  const render::Character a = baked(test::make_tube()), b = baked(test::make_tube());
  EXPECT_TRUE(
      std::equal(a.collapse_target.begin(), a.collapse_target.end(), b.collapse_target.begin()));
  EXPECT_TRUE(std::equal(a.position.begin(), a.position.end(), b.position.begin()));
}

TEST(CollapseTest, TextureStaysInPlaceAcrossASeam) {
  // a flat sheet has no shape to lose, so its cut texture can stay exact for a long way down
  const render::Character character = baked(test::make_cut_sheet(16));
  for (const std::uint32_t n : test::legal_counts(character)) {
    if (n < 12) break;
    for (const glm::uvec3& corner : test::triangles_at(character, n)) {
      glm::vec2 shift[3];
      for (int i = 0; i < 3; ++i) {
        const glm::vec3& p = character.position[corner[i]];
        shift[i] =
            glm::vec2(character.uv[corner[i]]) / 65535.0F - 0.4F * glm::vec2(p.y + 0.5F, p.z);
      }
      // all three corners lie in one chart, and each where its place says
      for (const glm::vec2& each : shift) {
        EXPECT_LT(glm::length(each - shift[0]), 1.0e-4F) << "at " << n;
      }
      EXPECT_TRUE(glm::length(shift[0]) < 1.0e-4F || glm::length(shift[0] - 0.5F) < 1.0e-4F)
          << "at " << n;
    }
  }
}

TEST(CollapseTest, StripeOfItsOwnColorIsNotCoveredByWhatIsBesideIt) {
  // colours from a palette: each is one place of the texture, so only area tells what is lost
  constexpr std::uint32_t kSide = 40;
  SourceCharacter source = test::make_empty_source();
  SourceImage& image = source.materials[0].base_color;
  for (std::uint32_t i = 0; i < 256; ++i) {
    if (i % 16 >= 8) std::fill_n(image.rgba.begin() + 4 * i, 3, std::uint8_t{0});
  }
  source.normals.emplace_back(1, 0, 0);
  source.uvs = {{0.25F, 0.5F}, {0.75F, 0.5F}};
  for (std::uint32_t i = 0; i < (kSide + 1) * (kSide + 1); ++i) {
    const glm::vec2 at(i % (kSide + 1), i / (kSide + 1));
    source.points.push_back(
        {{0.0F, at.x / kSide - 0.5F, at.y / kSide}, glm::u16vec4(0), {1, 0, 0, 0}});
  }
  for (std::uint32_t row = 0; row < kSide; ++row) {
    for (std::uint32_t column = 0; column < kSide; ++column) {
      const std::uint32_t uv = column == kSide / 2 ? 1 : 0, a = row * (kSide + 1) + column;
      test::add_triangle(source, {a, a + 1, a + kSide + 2}, {0, 0, 0}, {uv, uv, uv});
      test::add_triangle(source, {a, a + kSide + 2, a + kSide + 1}, {0, 0, 0}, {uv, uv, uv});
    }
  }
  const render::Character character = baked(source);
  for (const float share : {0.5F, 0.3F}) {
    const std::uint32_t n = character.legal_count[static_cast<std::uint32_t>(
        share * static_cast<float>(character.vertex_count()))];
    float black_m2 = 0.0F;
    for (const glm::uvec3& corner : test::triangles_at(character, n)) {
      const glm::vec3 &p = character.position[corner.x], &q = character.position[corner.y],
                      &r = character.position[corner.z];
      if (character.uv[corner.x].x > 32767U)
        black_m2 += 0.5F * glm::length(glm::cross(q - p, r - p));
    }
    EXPECT_NEAR(black_m2, 1.0F / kSide, 0.1F / kSide) << "at " << n;
  }
}

TEST(CollapseTest, WedgesOfASeamPointGoTogether) {
  const render::Character character = baked(test::make_cut_sheet(16));
  // on the cut, a legal level has both copies of a point or none
  for (const std::uint32_t n : test::legal_counts(character)) {
    if (n < 12) break;
    std::map<float, int> copies;
    for (std::uint32_t i = 0; i < n; ++i) {
      if (character.position[i].y == 0.0F) ++copies[character.position[i].z];
    }
    for (const auto& [z, count] : copies) EXPECT_EQ(count, 2) << "z " << z << " at " << n;
  }
}

TEST(CollapseTest, SheetKeepsItsOutline) {
  const render::Character character = baked(test::make_cut_sheet(16));
  const std::uint32_t n = character.coarsest_count;
  float area_m2 = 0.0F;
  for (const glm::uvec3& corner : test::triangles_at(character, n)) {
    area_m2 +=
        0.5F * glm::length(glm::cross(character.position[corner.y] - character.position[corner.x],
                                      character.position[corner.z] - character.position[corner.x]));
  }
  EXPECT_NEAR(area_m2, 1.0F, 1.0e-4F);
}

TEST(CollapseTest, PosesKeepWhatBends) {
  test::TubeOptions tube;
  tube.rings = 41;
  tube.has_elbow = true;
  SourceCharacter bending = test::make_tube(tube), stiff = bending;
  stiff.clips.clear();
  const auto near_elbow = [](const render::Character& character) {
    const std::uint32_t n = character.legal_count[120];
    int count = 0;
    for (std::uint32_t i = 0; i < n; ++i) {
      if (std::fabs(character.position[i].z - 0.9F) < 0.25F) ++count;
    }
    return count;
  };
  EXPECT_GT(near_elbow(baked(bending)), near_elbow(baked(stiff)) + 8);
}

/// Adds the surface of another one-jointed character, scaled and moved.
void append(SourceCharacter& source, const SourceCharacter& other, float scale,
            const glm::vec3& at) {
  const auto points = static_cast<std::uint32_t>(source.points.size());
  const auto normals = static_cast<std::uint32_t>(source.normals.size());
  const auto uvs = static_cast<std::uint32_t>(source.uvs.size());
  for (SourcePoint point : other.points) {
    point.position = point.position * scale + at;
    source.points.push_back(point);
  }
  source.normals.insert(source.normals.end(), other.normals.begin(), other.normals.end());
  source.uvs.insert(source.uvs.end(), other.uvs.begin(), other.uvs.end());
  for (SourceTriangle triangle : other.triangles) {
    for (SourceCorner& corner : triangle.corner) {
      corner = {corner.point + points, corner.normal + normals, corner.uv + uvs};
    }
    source.triangles.push_back(triangle);
  }
}

TEST(CollapseTest, LimbThatMovesMoreIsNotKeptAtTheExpenseOfTheOther) {
  test::TubeOptions options;
  options.rings = 41;
  options.has_elbow = true;
  SourceCharacter source = test::make_tube(options);
  SourceCharacter right = test::make_tube(options);
  for (SourcePoint& point : right.points) {  // mirrored; stands still
    point.position.y = -point.position.y;
    point.joint = glm::u16vec4(0);
    point.weight = {1, 0, 0, 0};
  }
  for (glm::vec3& normal : right.normals) normal.y = -normal.y;
  for (SourceTriangle& triangle : right.triangles)
    std::swap(triangle.corner[1], triangle.corner[2]);
  for (SourcePoint& point : source.points) point.position.y += 0.4F;
  append(source, right, 1.0F, {0.0F, -0.4F, 0.0F});
  const render::Character character = baked(source);
  for (const float share : {0.7F, 0.5F, 0.3F, 0.15F, 0.08F}) {
    const auto wanted =
        static_cast<std::uint32_t>(share * static_cast<float>(character.vertex_count()));
    const std::uint32_t n = character.legal_count[wanted];
    int left = 0;
    for (std::uint32_t i = 0; i < n; ++i) left += character.position[i].y > 0.0F ? 1 : 0;
    EXPECT_GT(left, static_cast<int>(0.38F * static_cast<float>(n))) << "at " << n;
    EXPECT_LT(left, static_cast<int>(0.62F * static_cast<float>(n))) << "at " << n;
  }
}

TEST(CollapseTest, PiecesThatOverlapGrowTogetherWithoutAGap) {
  test::TubeOptions options;
  options.height_m = 0.7F;
  options.bulge = 0.5F;
  SourceCharacter source = test::make_tube(options);
  append(source, test::make_tube(options), 1.0F, {0.0F, 0.0F, 0.6F});
  append(source, test::make_tube(options), 1.0F, {0.0F, 0.0F, 1.2F});
  const render::Character character = baked(source);
  for (const std::uint32_t n : {character.legal_count[28], character.legal_count[50]}) {
    for (float z = 0.1F; z < 1.8F; z += 0.02F) {
      bool is_covered = false;
      for (const glm::uvec3& corner : test::triangles_at(character, n)) {
        const float x = character.position[corner.x].z, y = character.position[corner.y].z,
                    w = character.position[corner.z].z;
        is_covered |= std::min({x, y, w}) <= z && z <= std::max({x, y, w});
      }
      EXPECT_TRUE(is_covered) << "at " << n << " vertices and z " << z;
    }
    test::expect_whole(character, n);
    test::expect_closed(character, n);
  }
}

TEST(CollapseTest, WhatIsHiddenGoesFirst) {
  test::TubeOptions options;
  options.bulge = 0.8F;
  SourceCharacter source = test::make_tube(options);
  append(source, test::make_tube(options), 0.5F, {0.0F, 0.0F, 0.45F});
  const render::Character character = baked(source);
  const std::uint32_t n = character.legal_count[character.vertex_count() / 6];
  std::uint32_t inside = 0;
  for (std::uint32_t i = 0; i < n; ++i) {
    const glm::vec3& p = character.position[i];
    inside += p.z > 0.4F && p.z < 1.4F && p.x * p.x + p.y * p.y < 0.08F * 0.08F ? 1 : 0;
  }
  EXPECT_LT(inside, n / 20);
}

TEST(CollapseTest, SmallPiecesVanishBeforeTheBodyIsLost) {
  test::TubeOptions body;
  body.bulge = 0.8F;
  SourceCharacter source = test::make_tube(body);
  // twenty buttons
  for (int i = 0; i < 20; ++i)
    append(source, test::make_cube(), 0.01F, {0.16F, 0, 0.2F + 0.07F * static_cast<float>(i)});
  const render::Character character = baked(source);
  EXPECT_LE(character.coarsest_count, 28U);
  for (const std::uint32_t n : test::legal_counts(character)) {
    test::expect_whole(character, n);
    test::expect_closed(character, n);
  }
  int buttons = 0;
  const std::uint32_t n = character.legal_count[60];
  for (std::uint32_t i = 0; i < n; ++i) buttons += character.position[i].x > 0.1555F ? 1 : 0;
  EXPECT_LT(buttons, 5);
}

TEST(CollapseTest, NoTriangleOfASheetSeenFromBothSidesLiesOnAnother) {
  const render::Character character = baked(test::make_cut_sheet());
  for (const std::uint32_t n : test::legal_counts(character)) {
    test::expect_whole(character, n);
    std::set<std::set<std::tuple<float, float, float>>> places;
    for (const glm::uvec3& corner : test::triangles_at(character, n)) {
      std::set<std::tuple<float, float, float>> own;
      for (int i = 0; i < 3; ++i) {
        const glm::vec3& p = character.position[corner[i]];
        own.insert({p.x, p.y, p.z});
      }
      EXPECT_TRUE(places.insert(own).second) << "at " << n;
    }
  }
}

TEST(CollapseTest, AsksWhetherLevelsWantTheirOwnColorsAndTakesTheAnswer) {
  test::TubeOptions options;
  options.columns = 24;
  options.rings = 60;
  const auto surface = rebuild(test::make_tube(options));
  ASSERT_TRUE(surface.ok());
  PoseSet poses{1, {}, {1.0F}};
  for (const SourcePoint& point : surface->points) poses.position.push_back(point.position);
  for (const bool answer : {false, true}) {
    CollapseOptions collapse_options;
    std::vector<std::uint32_t> asked;
    collapse_options.prefers_tones = [&](const CollapseOrder& so_far) {
      asked.push_back(so_far.coarsest_count);
      EXPECT_EQ(so_far.wedge.size(), surface->wedge_count());
      return answer;
    };
    const auto order = collapse(*surface, poses, collapse_options);
    ASSERT_TRUE(order.ok()) << order.status();
    ASSERT_FALSE(asked.empty());
    EXPECT_LE(asked.front(), 256U);
    EXPECT_GT(asked.front(), 240U);
    EXPECT_EQ(asked.size() > 1, !answer);
    EXPECT_TRUE(answer ? order->toned_count == asked.front() : order->toned_count <= 112U)
        << order->toned_count;
  }
}

TEST(CollapseTest, OrderDoesNotDependOnThreads) {
  test::TubeOptions options;
  options.has_elbow = true;
  const auto surface = rebuild(test::make_tube(options));
  ASSERT_TRUE(surface.ok());
  PoseSet poses{1, {}, {1.0F}};
  for (const SourcePoint& point : surface->points) poses.position.push_back(point.position);
  CollapseOptions collapse_options;
  const auto one = collapse(*surface, poses, collapse_options);
  collapse_options.threads = 5;
  const auto five = collapse(*surface, poses, collapse_options);
  ASSERT_TRUE(one.ok() && five.ok());
  EXPECT_EQ(one->wedge, five->wedge);
  EXPECT_EQ(one->target, five->target);
  EXPECT_EQ(one->triangle, five->triangle);
}

TEST(CollapseTest, RefusesPosesOfAnotherMesh) {
  const auto surface = rebuild(test::make_cube());
  ASSERT_TRUE(surface.ok());
  PoseSet poses{1, std::vector<glm::vec3>(7), {1.0F}};
  EXPECT_EQ(collapse(*surface, poses).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(CheckLevelsTest, AcceptsWholeLevels) {
  EXPECT_TRUE(check_levels(*render::make_character(test::make_tiny_character())).ok());
}

TEST(CheckLevelsTest, NamesAVertexWithoutATriangle) {
  render::CharacterData data = test::make_tiny_character();
  data.position.push_back(data.position.back());
  data.normal.push_back(data.normal.back());
  data.uv.push_back(data.uv.back());
  data.joint_index.push_back(data.joint_index.back());
  data.joint_weight.push_back(data.joint_weight.back());
  data.collapse_target.push_back(0);
  data.collapse_error_m.push_back(0);
  data.triangle_count_at.push_back(data.triangle_count_at.back());
  data.legal_count.push_back(39);
  const auto character = render::make_character(data);
  ASSERT_TRUE(character.ok()) << character.status();
  EXPECT_THAT(std::string(check_levels(*character).message()),
              ::testing::HasSubstr("vertex 38 has no triangle at 39"));
}

}  // namespace
}  // namespace throng::simplify
