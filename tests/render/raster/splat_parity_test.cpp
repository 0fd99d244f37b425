#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <random>

#include "simplify/points/points.hpp"
#include "support/tiny_character.hpp"
#include "throng/render/frame.hpp"
#include "throng/render/raster.hpp"

namespace throng::render {
namespace {

/// gl with so many samples a pixel, or null where this machine has none.
std::unique_ptr<Rasterizer> gl(const char* samples) {
  setenv("THRONG_GL_SAMPLES", samples, 1);
  auto made = make_rasterizer(RasterKind::kGl, 2);
  unsetenv("THRONG_GL_SAMPLES");
  EXPECT_TRUE(made.ok() || absl::IsUnavailable(made.status())) << made.status();
  return made.ok() ? std::move(*made) : nullptr;
}

Picture drawn(Rasterizer& rasterizer, std::span<const Splat> splats, const Camera& camera,
              const Viewport& viewport) {
  Look look;
  look.ground = false;
  FrameGeometry geometry;
  geometry.splats = splats;
  Picture picture;
  const absl::Status status =
      rasterizer.draw(geometry, camera, viewport, glm::dvec3(0.0), look, picture);
  EXPECT_TRUE(status.ok()) << status;
  return picture;
}

struct Likeness {
  double covered[2] = {};  // pixels' worth of change against the picture without splats
  double differs = 0;      // mean of the covered pixels, codes
};

Likeness compare(const Picture& a, const Picture& b, const Picture& empty) {
  Likeness result;
  double differs = 0.0;
  std::size_t seen = 0;
  for (std::size_t i = 0; i < a.rgbx.size(); i += 4) {
    int to_empty[2] = {0, 0}, between = 0;
    for (std::size_t c = i; c < i + 3; ++c) {
      to_empty[0] = std::max(to_empty[0], std::abs(int{a.rgbx[c]} - int{empty.rgbx[c]}));
      to_empty[1] = std::max(to_empty[1], std::abs(int{b.rgbx[c]} - int{empty.rgbx[c]}));
      between = std::max(between, std::abs(int{a.rgbx[c]} - int{b.rgbx[c]}));
    }
    for (int k = 0; k < 2; ++k) result.covered[k] += to_empty[k] / 255.0;
    if (std::max(to_empty[0], to_empty[1]) < 4) continue;
    differs += between;
    ++seen;
  }
  result.differs = differs / static_cast<double>(std::max<std::size_t>(seen, 1));
  return result;
}

std::vector<Splat> random_splats(std::uint32_t count, float low_m, float high_m) {
  std::mt19937 random(11);
  const auto uniform = [&] { return static_cast<float>(random() >> 8) * (1.0F / 16777216.0F); };
  std::vector<Splat> splats;
  for (std::uint32_t i = 0; i < count; ++i) {
    glm::vec3 normal(uniform() - 0.5F, -0.2F - uniform(), uniform() - 0.5F);
    const float radius_m = low_m + (high_m - low_m) * uniform();
    splats.push_back({{24 * uniform() - 12, 12 + 20 * uniform(), 18 * uniform() - 9},
                      i % 5 == 0 ? -radius_m : radius_m,
                      encode_octahedral(glm::normalize(normal)),
                      static_cast<std::uint32_t>(random()) & 0x3fffffffU,
                      i % 3 == 0 ? 0 : 64 + i % 192,  // slim, as points that go round a limb
                      kNobody});
  }
  return splats;
}

const Camera kNorth{.eye_world = {0, 0, 0}, .target_world = {0, 1, 0}};
const Camera kFlat{.eye_world = {0, 0, 0},
                   .target_world = {0, 1, 0},
                   .ortho_height_m = 14.0,
                   .near_m = 1.0,
                   .far_m = 100.0};

TEST(SplatParityTest, OpenGlDrawsTheSameDiscs) {
  const auto visibility = *make_rasterizer(RasterKind::kVisibility, 2);
  const Viewport viewport{320, 200};
  const auto splats = random_splats(900, 0.05F, 0.6F);
  for (const char* samples : {"1", "4"}) {
    const auto other = gl(samples);
    if (other == nullptr) GTEST_SKIP() << "no OpenGL";
    for (const Camera& camera : {kNorth, kFlat}) {
      const Picture empty = drawn(*visibility, {}, camera, viewport);
      const Picture ours = drawn(*visibility, splats, camera, viewport);
      const Likeness same = compare(ours, drawn(*other, splats, camera, viewport), empty);
      EXPECT_GT(same.covered[0], 2000.0);
      EXPECT_NEAR(same.covered[1] / same.covered[0], 1.0, 0.02);
      // one sample is smoothed afterwards
      EXPECT_LT(same.differs, samples[0] == '4' ? 6.0 : 22.0);
    }
  }
}

TEST(SplatParityTest, TilesOfAWidePictureShareTheirDiscs) {
  const auto visibility = *make_rasterizer(RasterKind::kVisibility, 2);
  const auto other = gl("4");
  if (other == nullptr) GTEST_SKIP() << "no OpenGL";
  const Viewport viewport{8208, 64};
  const auto splats = random_splats(60, 6.0F, 24.0F);
  Camera camera = kFlat;
  camera.ortho_height_m = 64.0;  // a pixel a metre; tiles of 2048 px begin at these places
  std::vector<Splat> wide;
  for (const Splat& splat : splats) {
    wide.push_back(splat);
    wide.back().position_relative.x *= 340.0F;
  }
  for (const float border : {-2066.0F, -8.0F, 2050.0F}) {
    wide.push_back(splats[0]);
    wide.back().position_relative = {border, 20.0F, 0.0F};
    wide.back().radius_m = -40.0F;
  }
  const Picture empty = drawn(*visibility, {}, camera, viewport);
  const Likeness same = compare(drawn(*visibility, wide, camera, viewport),
                                drawn(*other, wide, camera, viewport), empty);
  EXPECT_GT(same.covered[0], 1000.0);
  EXPECT_NEAR(same.covered[1] / same.covered[0], 1.0, 0.02);
  EXPECT_LT(same.differs, 3.0);
}

TEST(SplatParityTest, WhatIsNowhereOrBehindIsNotDrawn) {
  const auto other = gl("1");
  if (other == nullptr) GTEST_SKIP() << "no OpenGL";
  const Viewport viewport{160, 120};
  const float nan = std::nanf("");
  const auto front = encode_octahedral({0.0F, -1.0F, 0.0F});
  std::vector<Splat> splats;
  for (const glm::vec3 p : {glm::vec3(0, -5, 0), {nan, 10, 0}, {0, nan, 0}, {0, 0, 0}}) {
    splats.push_back({p, 1.0F, front, 0x3ff, 0, kNobody});
  }
  splats.push_back({{0, 10, 0}, nan, front, 0x3ff, 0, kNobody});
  splats.push_back({{0, 10, 0}, 1.0F, encode_octahedral({0, 1, 0}), 0x3ff, 0, kNobody});
  EXPECT_EQ(drawn(*other, splats, kNorth, viewport).rgbx, drawn(*other, {}, kNorth, viewport).rgbx);
}

TEST(SplatParityTest, OpenGlDrawsTheSamePeople) {
  CharacterData data = test::make_tiny_character();
  simplify::sample_points(data, {.count = 1024});
  auto cast = std::make_shared<Cast>();
  cast->members.push_back({make_character(std::move(data)).value(), 1.0F});
  auto membership = std::make_shared<Membership>();
  AgentFrame frame;
  for (int i = 0; i < 48; ++i) {
    membership->ids.push_back(static_cast<std::uint64_t>(i + 1));
    frame.position_m.emplace_back(1.2F * static_cast<float>(i % 6) - 3.0F,
                                  1.5F * static_cast<float>(i / 6), 0.0F);
    frame.heading_rad.push_back(0.7F * static_cast<float>(i));
  }
  membership->epoch = 1;
  frame.membership = membership;
  Crowd crowd(cast, CrowdSettings{});
  ASSERT_TRUE(crowd.push(frame).ok());
  const auto picture_of = [&](RasterKind kind, FormRule form, Picture& picture) {
    auto pipeline = FramePipeline::make(cast, {.raster = kind, .threads = 2});
    if (!pipeline.ok()) return false;
    ViewSettings view;
    view.camera = {.eye_world = {0, -6, 2.5}, .target_world = {0, 3, 0.9}};
    view.viewport = {317, 203};
    view.selection.form = form;
    FrameStats stats;
    const absl::Status status = (*pipeline)->render(crowd, 0, view, picture, stats);
    EXPECT_TRUE(status.ok()) << status;
    EXPECT_EQ(stats.counters.drawn_as[3] > 0, form == FormRule::kPoints);
    return true;
  };
  Picture gl_points, points, gl_mesh;
  if (!picture_of(RasterKind::kGl, FormRule::kPoints, gl_points)) GTEST_SKIP() << "no OpenGL";
  picture_of(RasterKind::kVisibility, FormRule::kPoints, points);
  picture_of(RasterKind::kGl, FormRule::kMesh, gl_mesh);
  const auto mean = [&](const Picture& other) {
    double sum = 0.0;
    for (std::size_t i = 0; i < other.rgbx.size(); ++i) {
      sum += std::abs(int{gl_points.rgbx[i]} - int{other.rgbx[i]});
    }
    return sum / static_cast<double>(other.rgbx.size());
  };
  EXPECT_LT(mean(points), 1.5);
  EXPECT_LT(mean(points), mean(gl_mesh));  // nearer than another form of the same people
}

}  // namespace
}  // namespace throng::render
